// What runs a charge, for the worker of the page and for programs without a page.

import { Codecs } from "./codec";
import type { Database, PresetData } from "./data";
import { Native, type Start } from "./native";
import { Session, type Request } from "./session";

export class Engine {
  readonly codecs: Codecs;
  private readonly native: Native;

  constructor(
    module: WebAssembly.Module,
    database: Database,
    readonly preset: PresetData,
  ) {
    this.codecs = new Codecs(database);
    const scenario = Uint8Array.from(atob(preset.scenario), (letter) => letter.charCodeAt(0));
    this.native = new Native(module, scenario);
  }

  /** A charge from its beginning; the one before is over. */
  begin(start: Start, request: Request): Session {
    return new Session(this.native, this.codecs, this.preset, start, { ...request });
  }

  /** As the preset has it. */
  get start(): Start {
    return { seed: 0, ...this.preset.initial, resistance_factor: 1, capacity_factor: 1 };
  }

  get request(): Request {
    return {
      mode: "fastest",
      reference_A: this.preset.limits.reference_A,
      full_by_s: 1800,
      cooling_W: this.preset.initial.cooling_power_W,
    };
  }
}
