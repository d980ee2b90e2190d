// Faults of a run, as hil_sim/faults.

import { counterOf, withCounter, withSignal, type Codecs, type Frame } from "./codec";
import type { FaultData } from "./data";
import type { Truth } from "./native";
import type { FaultRandom } from "./random";

export const SENSORS = [
  "current_A",
  "voltage_V",
  "surface_temperature_K",
  "coolant_temperature_K",
  "cooling_power_W",
] as const;

const CELSIUS_OFFSET_K = 273.15;
const SYNC = "SYNC";
const HIGHEST_ID = 0x7ff;
const MOST_DATA = 8;

/** One fault of a run, from a period of the charge on. */
export class Fault {
  isActive = false;
  private kept: Frame[] = [];
  private lastHealthy = NaN;
  private age_s = 0;

  constructor(
    readonly data: FaultData,
    readonly onset: number,
    private readonly codecs: Codecs,
    private readonly period_s: number,
    private readonly random: FaultRandom,
  ) {}

  /** Periods that it lasts. */
  get length(): number {
    if (typeof this.data["for_s"] === "number") {
      return Math.max(1, Math.ceil(this.data["for_s"] / this.period_s - 1e-9));
    }
    return this.data.for_periods ?? Infinity;
  }

  begin(chargePeriod: number | null): void {
    const age = chargePeriod === null ? -1 : chargePeriod - this.onset;
    this.isActive = age >= 0 && age < this.length;
  }

  /** What arrives of frames on their way to or from the ECU. */
  frames(frames: Frame[], isFromEcu: boolean): Frame[] {
    const kind = this.data.kind;
    if (kind === "bus-off") {
      const sync = this.codecs.named(SYNC).id;
      return frames.filter((frame) => !this.isActive || frame.id === sync);
    }
    if (kind === "bus-flood") {
      return this.isActive && !isFromEcu ? this.flooded(frames) : frames;
    }
    if (this.data["message"] === undefined) {
      return frames;
    }
    const id = this.codecs.named(this.text("message")).id;
    return frames.flatMap((frame) => (frame.id === id ? this.changed(frame) : [frame]));
  }

  /** What the sensors say in place of what they should. */
  readings(healthy: number[], truth: Truth): number[] {
    const place = SENSORS.findIndex((name) => name === this.data["sensor"]);
    if (place < 0) {
      return healthy;
    }
    const readings = healthy.slice();
    if (this.isActive) {
      readings[place] = this.reading(healthy[place]!, truth);
      this.age_s += this.period_s;
    } else {
      this.lastHealthy = healthy[place]!;
    }
    return readings;
  }

  /** Current of the coming period in place of the one that the charger's rule gives. */
  supplied_A(obedient_A: number, last_A: number): number {
    if (!this.isActive) {
      return obedient_A;
    }
    switch (this.data.kind) {
      case "charger-stuck":
        return last_A;
      case "charger-gain":
        return this.number("factor") * obedient_A;
      default:
        return obedient_A;
    }
  }

  private reading(healthy: number, truth: Truth): number {
    switch (this.data.kind) {
      case "sensor-stuck":
        return this.lastHealthy;
      case "sensor-drifting":
        return healthy + this.number("rate_per_s") * this.age_s;
      case "sensor-biased":
        return healthy + this.number("offset");
      case "sensor-out-of-range":
        return this.number("value");
      case "sensor-jumping":
        return healthy + this.number("amplitude") * (this.random.below(2) === 0 ? -1 : 1);
      case "sensor-unit-swapped":
        return this.text("sensor").endsWith("_K") ? healthy - CELSIUS_OFFSET_K : 1000 * healthy;
      case "sensor-not-available":
        return NaN;
      case "surface-above-core":
        return truth.core_K + this.number("excess_K");
      default:
        throw new Error(`fault '${this.data.kind}': the page does not know it; reload the page`);
    }
  }

  private changed(frame: Frame): Frame[] {
    switch (this.data.kind) {
      case "message-lost":
        return this.isActive ? [] : [frame];
      case "message-delayed": {
        this.kept.push(frame);
        const waiting = this.isActive ? this.number("delay_periods") : 0;
        return this.kept.splice(0, Math.max(0, this.kept.length - waiting));
      }
      case "message-repeated":
        return this.isActive ? [frame, ...this.copies(frame)] : [frame];
      case "message-frozen":
        if (!(this.isActive && this.kept.length > 0)) {
          this.kept = [frame];
        }
        return this.kept.slice();
      case "message-reordered":
        return this.reordered(frame);
      default:
        return this.isActive || this.data.kind === "message-masqueraded"
          ? this.forged(frame)
          : [frame];
    }
  }

  private copies(frame: Frame): Frame[] {
    return Array.from({ length: Number(this.data["copies"] ?? 1) }, () => frame);
  }

  private reordered(frame: Frame): Frame[] {
    const earlier = this.kept.pop();
    if (earlier !== undefined) {
      return [frame, earlier];
    }
    if (!this.isActive) {
      return [frame];
    }
    this.kept = [frame];
    return [];
  }

  private forged(frame: Frame): Frame[] {
    const data = frame.data.slice();
    switch (this.data.kind) {
      case "byte-corrupted":
        data[this.number("byte")]! ^= Number(this.data["mask"] ?? 0xff);
        return [{ id: frame.id, data }];
      case "message-wrong-id":
        return [{ id: this.number("frame_id"), data }];
      case "message-wrong-length": {
        const cut = new Uint8Array(this.number("length"));
        cut.set(data.subarray(0, cut.length));
        return [{ id: frame.id, data: cut }];
      }
      case "message-masqueraded":
        return [this.masqueraded(frame)];
      case "message-contested":
        return this.contested(frame);
      default:
        throw new Error(`fault '${this.data.kind}': the page does not know it; reload the page`);
    }
  }

  private masqueraded(frame: Frame): Frame {
    if (!(this.isActive && this.kept.length > 0)) {
      this.kept = [frame];
      return frame;
    }
    const message = this.codecs.named(this.text("message"));
    const counter = counterOf(this.kept[0]!.data);
    return { id: frame.id, data: withCounter(message, frame.data, counter) };
  }

  private contested(frame: Frame): Frame[] {
    const message = this.codecs.named(this.text("message"));
    const isBehind = (this.data["position"] ?? "behind") === "behind";
    const changed = withSignal(message, frame.data, this.text("signal"), this.number("value"));
    const counter = counterOf(frame.data) + (isBehind ? 1 : 0);
    const other = { id: frame.id, data: withCounter(message, changed, counter) };
    return isBehind ? [frame, other] : [other, frame];
  }

  private flooded(frames: Frame[]): Frame[] {
    const known = this.codecs.byId;
    const free = Array.from({ length: HIGHEST_ID + 1 }, (_, id) => id).filter((id) => !known.has(id));
    const count = Number(this.data["frames_per_period"] ?? 400);
    const ids = Array.from({ length: count }, () => free[this.random.below(free.length)]!);
    const lengths = ids.map(() => this.random.below(MOST_DATA + 1));
    const noise = this.random.bytes(MOST_DATA * count);
    const foreign = ids.map((id, i) => ({
      id,
      data: noise.slice(MOST_DATA * i, MOST_DATA * i + lengths[i]!),
    }));
    if (this.data["position"] === "before") {
      return [...foreign, ...frames];
    }
    if (this.data["position"] === "after") {
      return [...frames, ...foreign];
    }
    const gaps = Math.max(1, frames.length - 1);
    const share = (gap: number) => Math.floor((gap * foreign.length) / gaps);
    return frames.flatMap((frame, gap) =>
      gap === 0 ? [frame] : [...foreign.slice(share(gap - 1), share(gap)), frame],
    );
  }

  private number(key: string): number {
    return Number(this.data[key]);
  }

  private text(key: string): string {
    return String(this.data[key]);
  }
}
