// What the page is given besides its own files: presets, the CAN database, rows of the fault matrix.

export interface Signal {
  name: string;
  start: number;
  length: number;
  scale: number;
  offset_steps: number;
  lowest: number;
  highest: number;
}

export interface Message {
  name: string;
  id: number;
  length: number;
  data_ids: number[]; // none: not protected
  cycle_s: number;
  signals: Signal[];
}

export interface Database {
  messages: Message[];
  choices: Record<string, Record<string, string>>; // by signal
  faults: string[]; // by number
}

export interface Limits {
  core_K: number;
  surface_K: number;
  voltage_V: number;
  soc: number;
  completion_soc: number;
  reference_A: number;
}

export interface Range {
  low: number;
  high: number;
}

export interface PresetData {
  name: string;
  description: string;
  preset_hash: string;
  model_hash: string;
  scenario: string; // session_scenario_t, base64
  period_s: number;
  limits: Limits;
  initial: { soc: number; temperature_K: number; cooling_power_W: number };
  temperature_K: Range; // of a start
  cooling_power_W: Range;
  is_family: boolean;
  permitted_A: number; // by which the measured current may miss the command
  growth_A: number; // of the current in a period
}

export type FaultData = { kind: string; for_periods?: number } & Record<string, string | number>;

export interface Row {
  name: string;
  group: string;
  fault: FaultData;
  expect: {
    reaction: "stops" | "resumes" | "restrains" | "rides-through";
    deadline_periods: number | null;
    resumes_periods: number | null;
    latches: string | null;
    latch_deadline_periods: number | null;
    state: string;
  };
  after_periods: number;
  needs: string[];
  note: string;
  start: { soc: number; temperature_K: number; cooling_power_W: number; onset: number };
}

export interface Config {
  bus: string | null; // that is shown live
  presets: string[]; // the first is the one to begin with
  packs: string; // the preset that there are packs of
  limits: LimitFiles | null; // null where a server makes the calibration of any tighter limits
}

/** By preset and limit the values of which there are files, one limit at a time. */
export type LimitFiles = Record<string, Record<string, string[]>>;

/** A preset whose limits were lowered, and its file. */
export interface Tightened {
  preset: PresetData;
  rows: Row[];
  file: string;
}

/** Limits by their keys in a preset; the reason in an Error where they are refused. */
export async function fetchTightened(
  name: string,
  limits: Record<string, string>,
  files: LimitFiles | null,
): Promise<Tightened> {
  const response = await fetch(
    files === null ? `limits/${name}.json?${new URLSearchParams(limits)}` : fileOf(name, limits, files[name] ?? {}),
  );
  if (!response.ok) {
    throw new Error(`the server answers ${response.status} when asked for limits; reload the page`);
  }
  const made = (await response.json()) as Tightened | { error: string };
  if ("error" in made) {
    throw new Error(made.error);
  }
  return made;
}

function fileOf(name: string, limits: Record<string, string>, made: Record<string, string[]>): string {
  const asked = Object.entries(limits);
  for (const [limit, said] of asked) {
    const value = made[limit]?.find((one) => Number(one) === Number(said));
    if (value === undefined || said.trim() === "") {
      const choice = made[limit]?.join(" or ");
      throw new Error(
        `limits.${limit}: these files have ${choice ?? "only the preset's"}, ` +
          `not '${said.slice(0, 40)}'; 'bms dashboard' makes any that is tighter`,
      );
    }
    if (asked.length === 1) {
      return `limits/${name}/${limit}=${value}.json`;
    }
  }
  throw new Error("these files have one tighter limit at a time; 'bms dashboard' makes any together");
}

export async function fetchData<T>(path: string): Promise<T> {
  const response = await fetch(path);
  if (!response.ok) {
    throw new Error(`${path}: the server answers ${response.status}; reload the page`);
  }
  return (await response.json()) as T;
}
