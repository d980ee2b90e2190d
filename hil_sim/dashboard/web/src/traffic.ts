// What passes on the bus: values as last heard, rates, ages, faults. As hil_sim/monitor.

import { decode, isIntact, type Codecs, type Frame, type Values } from "./codec";
import type { Message } from "./data";

const RATE_WINDOW_S = 3.0;
const STALE_CYCLES = 3.0;
const FIRST_FAULTS = 20; // in Diagnostics; the later ones are in Diagnostics2
const NO_FAULT = 255;

export interface MessageTraffic {
  name: string;
  id: number;
  rate_per_s: number;
  age_s: number | null;
  is_stale: boolean;
  refused: number;
}

class Meter {
  values: Values = {};
  refused = 0;
  private times_s: number[] = [];
  private last_s: number | null = null;

  constructor(readonly message: Message) {}

  take(time_s: number, data: Uint8Array): boolean {
    this.times_s.push(time_s);
    if (!isIntact(this.message, data)) {
      this.refused++;
      return false;
    }
    this.values = decode(this.message, data);
    this.last_s = time_s;
    return true;
  }

  traffic(now_s: number): MessageTraffic {
    const begin_s = now_s - RATE_WINDOW_S;
    this.forget(begin_s);
    const first_s = this.times_s[0];
    const span_s = first_s === undefined ? 0 : this.times_s.at(-1)! - first_s;
    const age_s = this.last_s === null ? null : now_s - this.last_s;
    return {
      name: this.message.name,
      id: this.message.id,
      rate_per_s: span_s > 0 ? (this.times_s.length - 1) / span_s : 0,
      age_s,
      is_stale: age_s !== null && age_s > STALE_CYCLES * this.message.cycle_s,
      refused: this.refused,
    };
  }

  private forget(begin_s: number): void {
    const kept = this.times_s.findIndex((time_s) => time_s >= begin_s);
    this.times_s = kept < 0 ? [] : this.times_s.slice(kept);
  }

  get isLong(): boolean {
    return this.times_s.length > 4096;
  }

  shorten(now_s: number): void {
    this.forget(now_s - RATE_WINDOW_S);
  }
}

/** Bits of the faults, from the two messages that carry them. As hil_sim/bus/fault_bits.py. */
export class FaultBits {
  active: bigint | null = null;
  latched: bigint | null = null;
  private more: [bigint, bigint] = [0n, 0n]; // active, latched

  take(values: Values): void {
    const page = values["FaultPage"];
    const more = values["MoreFaults"];
    if ((page === 0 || page === 1) && more !== null && more !== undefined) {
      this.more[page] = BigInt(more) << BigInt(FIRST_FAULTS);
    }
    const first = values["FirstFault"];
    if (first === NO_FAULT) {
      this.more[1] = 0n;
    } else if (first !== null && first !== undefined && first >= FIRST_FAULTS) {
      this.more[1] |= 1n << BigInt(first);
    }
    this.active = this.joined(values["ActiveFaults"], this.active, this.more[0]);
    this.latched = this.joined(values["LatchedFaults"], this.latched, this.more[1]);
  }

  private joined(told: number | null | undefined, known: bigint | null, more: bigint) {
    if ((told === null || told === undefined) && known === null) {
      return null;
    }
    const early =
      told === null || told === undefined
        ? (known ?? 0n) % (1n << BigInt(FIRST_FAULTS))
        : BigInt(told);
    return early | more;
  }
}

export class Traffic {
  frames = 0;
  foreign = 0;
  readonly faults = new FaultBits();
  private readonly meters: ReadonlyMap<number, Meter>;

  constructor(codecs: Codecs) {
    this.meters = new Map(
      codecs.database.messages.map((message) => [message.id, new Meter(message)]),
    );
  }

  take(time_s: number, frame: Frame): void {
    this.frames++;
    const meter = this.meters.get(frame.id);
    if (meter === undefined) {
      this.foreign++;
      return;
    }
    if (meter.take(time_s, frame.data)) {
      this.faults.take(meter.values);
    }
    if (meter.isLong) {
      meter.shorten(time_s);
    }
  }

  messages(now_s: number): MessageTraffic[] {
    return [...this.meters.values()].map((meter) => meter.traffic(now_s));
  }

  readings(): Values {
    return Object.assign({}, ...[...this.meters.values()].map((meter) => meter.values)) as Values;
  }
}
