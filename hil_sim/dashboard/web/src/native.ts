// The WebAssembly module: the C firmware, cell, sensors and charger. See hil_sim/dashboard/native.

import type { Frame } from "./codec";

export interface Start {
  seed: number;
  soc: number;
  temperature_K: number;
  cooling_power_W: number;
  resistance_factor: number;
  capacity_factor: number;
}

export interface Truth {
  soc: number;
  core_K: number;
  surface_K: number;
  coolant_K: number;
  voltage_V: number;
  current_A: number;
  cooling_W: number;
  peak: { soc: number; core_K: number; surface_K: number; voltage_V: number };
}

interface Exports extends WebAssembly.Exports {
  memory: WebAssembly.Memory;
  scenario_address(): number;
  scenario_size(): number;
  settings_address(): number;
  settings_size(): number;
  readings_address(): number;
  values_address(): number;
  frames_address(): number;
  frame_size(): number;
  is_accepted(): number;
  begin(): void;
  start_ecu(): void;
  measure(): void;
  publish(hasMode: number): number;
  exchange(count: number): number;
  hear(count: number): number;
  told(): number;
  obey(usable_A: number): number;
  supply(current_A: number): void;
  cool(full_W: number): void;
  advance(): void;
  look(): number;
  begin_beside(): void;
  advance_beside(): number;
  look_beside(): number;
}

const READINGS = 5;
const FRAME_BYTES = 16;
const SETTINGS_BYTES = 48;
const MOST_FRAMES = 1024;

export class Native {
  private readonly exports: Exports;
  private readonly view: DataView;
  private readonly bytes: Uint8Array;

  constructor(module: WebAssembly.Module, scenario: Uint8Array) {
    this.exports = new WebAssembly.Instance(module, {}).exports as Exports;
    this.view = new DataView(this.exports.memory.buffer);
    this.bytes = new Uint8Array(this.exports.memory.buffer);
    const sizes = [
      this.exports.scenario_size() - scenario.length,
      this.exports.settings_size() - SETTINGS_BYTES,
      this.exports.frame_size() - FRAME_BYTES,
    ];
    if (sizes.some((difference) => difference !== 0)) {
      throw new Error("the preset was made for another build of the module; reload the page");
    }
    this.bytes.set(scenario, this.exports.scenario_address());
    if (this.exports.is_accepted() === 0) {
      throw new Error("the firmware refuses this calibration; the one before stays in force");
    }
  }

  begin(start: Start): void {
    const at = this.exports.settings_address();
    this.view.setUint32(at, start.seed, true);
    const numbers = [
      start.soc,
      start.temperature_K,
      start.cooling_power_W,
      start.resistance_factor,
      start.capacity_factor,
    ];
    numbers.forEach((value, i) => this.view.setFloat64(at + 8 + 8 * i, value, true));
    this.exports.begin();
  }

  startEcu(): void {
    this.exports.start_ecu();
  }

  /** Current, voltage, surface and coolant temperature, cooling power, as the sensors have them. */
  measure(): number[] {
    this.exports.measure();
    const at = this.exports.readings_address();
    return Array.from({ length: READINGS }, (_, i) => this.view.getFloat64(at + 8 * i, true));
  }

  publish(values: readonly number[], hasMode: boolean): Frame[] {
    const at = this.exports.values_address();
    values.forEach((value, i) => this.view.setFloat64(at + 8 * i, value, true));
    return this.read(this.exports.publish(hasMode ? 1 : 0));
  }

  /** One step of the ECU on these frames, and its answers. */
  exchange(frames: readonly Frame[]): Frame[] {
    return this.read(this.exports.exchange(this.write(frames)));
  }

  /** What the charger may supply after the ECU's frames; NaN without a usable command. */
  hear(frames: readonly Frame[]): number {
    return this.exports.hear(this.write(frames));
  }

  /** Payload of the last command in sequence; null where none came. */
  told(length: number): Uint8Array | null {
    const at = this.exports.told();
    return at === 0 ? null : this.bytes.slice(at, at + length);
  }

  obey(usable_A: number): number {
    return this.exports.obey(usable_A);
  }

  supply(current_A: number): void {
    this.exports.supply(current_A);
  }

  cool(full_W: number): void {
    this.exports.cool(full_W);
  }

  advance(): void {
    this.exports.advance();
  }

  look(): Truth {
    return this.truthAt(this.exports.look());
  }

  beginBeside(): void {
    this.exports.begin_beside();
  }

  /** One period of S-CBF; whether its charge goes on. */
  advanceBeside(): boolean {
    return this.exports.advance_beside() === 0;
  }

  lookBeside(): Truth {
    return this.truthAt(this.exports.look_beside());
  }

  private truthAt(at: number): Truth {
    const number = (place: number) => this.view.getFloat64(at + 8 * place, true);
    return {
      soc: number(0),
      core_K: number(1),
      surface_K: number(2),
      coolant_K: number(3),
      voltage_V: number(4),
      current_A: number(5),
      cooling_W: number(6),
      peak: { soc: number(7), core_K: number(8), surface_K: number(9), voltage_V: number(10) },
    };
  }

  private write(frames: readonly Frame[]): number {
    const count = Math.min(frames.length, MOST_FRAMES);
    let at = this.exports.frames_address();
    for (const frame of frames.slice(0, count)) {
      this.view.setUint32(at, frame.id, true);
      this.bytes[at + 4] = frame.data.length;
      this.bytes.fill(0, at + 5, at + 13);
      this.bytes.set(frame.data, at + 5);
      at += FRAME_BYTES;
    }
    return count;
  }

  private read(count: number): Frame[] {
    const begin = this.exports.frames_address();
    return Array.from({ length: count }, (_, i) => {
      const at = begin + FRAME_BYTES * i;
      const length = this.bytes[at + 4]!;
      return {
        id: this.view.getUint32(at, true),
        data: this.bytes.slice(at + 5, at + 5 + length),
      };
    });
  }
}
