// What page and worker tell each other.

import type { Database, PresetData, Row } from "./data";
import type { Start } from "./native";
import type { Request, Snapshot } from "./session";

export type ToWorker =
  | { type: "load"; module: WebAssembly.Module; database: Database; preset: PresetData }
  | { type: "begin"; start: Start; request: Request; isBeside: boolean; row?: Row }
  | { type: "request"; request: Request }
  | { type: "speed"; factor: number } // of real time; Infinity: as fast as it goes
  | { type: "run"; isRunning: boolean }
  | { type: "beside"; isOn: boolean }
  | { type: "inject"; row: Row }
  | { type: "log" };

export type FromWorker =
  | { type: "snapshot"; run: number; snapshot: Snapshot; samples: Float64Array }
  | { type: "loaded"; preset: PresetData }
  | { type: "log"; lines: string[] }
  | { type: "error"; message: string };
