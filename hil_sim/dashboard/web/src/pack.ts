// A pack that charges in the page, its cells as a heat map. Runs between two frames of the page in
// pieces, so that it stays responsive.

import { SPEEDS } from "./controls";
import { fetchData, type Config, type Database, type Limits } from "./data";
import { byId, element, setText } from "./dom";
import { duration } from "./panels";
import "./style.css";

interface Packs {
  name: string;
  limits: Limits;
  period_s: number;
  packs: Record<string, string>; // pack_scenario_t by the number of cells, base64
}

interface Exports extends WebAssembly.Exports {
  memory: WebAssembly.Memory;
  scenario_address(): number;
  scenario_size(): number;
  begin(): void;
  advance(periods: number): number;
  look(): number;
}

interface Cell {
  soc: number;
  core_K: number;
  surface_K: number;
  voltage_V: number;
  peak_core_K: number;
  peak_voltage_V: number;
}

interface Look {
  time_s: number;
  current_A: number;
  outcome: string;
  governing: number;
  constraint: string;
  cells: Cell[];
}

const OUTCOMES = ["charging", "complete", "fault", "time limit"];
const NO_CELL = 255;
const WORK_MS = 12;
const PERIODS_AT_ONCE = 20;
const HEAD = 5; // numbers of a pack_page_look_t before its cells
const WIDTH = 8; // and of a cell

type Shown = "core_K" | "soc" | "voltage_V";
const SHOWN: Record<Shown, { from: (limits: Limits) => number; to: (limits: Limits) => number; text: (value: number) => string }> = {
  core_K: { from: (l) => l.core_K - 20, to: (l) => l.core_K, text: (v) => `${v.toFixed(2)} K` },
  soc: { from: () => 0, to: (l) => l.soc, text: (v) => `${(100 * v).toFixed(2)} %` },
  voltage_V: { from: (l) => l.voltage_V - 1, to: (l) => l.voltage_V, text: (v) => `${v.toFixed(3)} V` },
};
const STEPS = 10; // of colour

class Pack {
  private readonly exports: Exports;

  constructor(
    module: WebAssembly.Module,
    scenario: Uint8Array,
    private readonly count: number,
    private readonly constraints: Record<string, string>,
  ) {
    this.exports = new WebAssembly.Instance(module, {}).exports as Exports;
    if (this.exports.scenario_size() !== scenario.length) {
      throw new Error("the pack was made for another build of the module; reload the page");
    }
    new Uint8Array(this.exports.memory.buffer).set(scenario, this.exports.scenario_address());
    this.exports.begin();
  }

  /** Whether the charge goes on. */
  advance(periods: number): boolean {
    return this.exports.advance(periods) !== 0;
  }

  look(): Look {
    const numbers = new Float64Array(this.exports.memory.buffer, this.exports.look(), HEAD + WIDTH * this.count);
    return {
      time_s: numbers[0]!,
      current_A: numbers[1]!,
      outcome: OUTCOMES[numbers[2]!] ?? "unknown",
      governing: numbers[3]!,
      constraint: (this.constraints[String(numbers[4]!)] ?? "unknown").toLowerCase(),
      cells: Array.from({ length: this.count }, (_, i) => {
        const at = HEAD + WIDTH * i;
        return {
          soc: numbers[at]!,
          core_K: numbers[at + 1]!,
          surface_K: numbers[at + 2]!,
          voltage_V: numbers[at + 3]!,
          peak_core_K: numbers[at + 5]!,
          peak_voltage_V: numbers[at + 7]!,
        };
      }),
    };
  }
}

async function main(): Promise<void> {
  const [config, database, module] = await Promise.all([
    fetchData<Config>("data/config.json"),
    fetchData<Database>("data/database.json"),
    fetch("pack.wasm").then(async (answer) => WebAssembly.compile(await answer.arrayBuffer())),
  ]);
  const data = await fetchData<Packs>(`data/${config.packs}.packs.json`);
  const select = (id: string) => byId<HTMLSelectElement>(id);
  select("cells").replaceChildren(...Object.keys(data.packs).map((n) => new Option(n, n, false, n === "16")));
  select("speed").replaceChildren(...SPEEDS.map(([name, factor]) => new Option(name, String(factor), false, factor === 100)));
  setText(byId("source"), `${data.name}, simulated in this page`);
  let pack: Pack;
  let tiles: HTMLButtonElement[] = [];
  let chosen: number | null = null;
  let owed_s = 0;
  let last_ms = 0;
  let run = 0;

  const show = () => {
    const look = pack.look();
    const key = select("shown").value as Shown;
    const { from, to, text } = SHOWN[key];
    const [low, high] = [from(data.limits), to(data.limits)];
    setText(byId("state"), look.outcome);
    setText(byId("clock"), duration(look.time_s));
    const who = look.governing === NO_CELL ? "no cell limits the current" : `cell ${look.governing + 1} governs, by its ${look.constraint}`;
    setText(byId("governs"), `${look.current_A.toFixed(2)} A; ${who}`);
    setText(byId("legend"), `pale: ${text(low)} and less; dark: ${text(high)}, the limit; framed: the cell that governs`);
    tiles.forEach((tile, i) => {
      const cell = look.cells[i]!;
      const share = Math.min(1, Math.max(0, (cell[key] - low) / (high - low)));
      tile.dataset["heat"] = String(Math.round(STEPS * share));
      tile.dataset["governs"] = String(i === look.governing);
      tile.dataset["peak"] = String(cell.peak_core_K);
      setText(tile.querySelector("b")!, text(cell[key]));
    });
    if (chosen !== null && look.cells[chosen] !== undefined) {
      const cell = look.cells[chosen]!;
      setText(
        byId("detail"),
        `Cell ${chosen + 1}: core ${cell.core_K.toFixed(2)} K (highest ${cell.peak_core_K.toFixed(2)} of ${data.limits.core_K} K), ` +
          `surface ${cell.surface_K.toFixed(2)} K, ${cell.voltage_V.toFixed(3)} V (highest ${cell.peak_voltage_V.toFixed(3)} of ${data.limits.voltage_V} V), ` +
          `${(100 * cell.soc).toFixed(2)} %`,
      );
    }
    document.body.dataset["time"] = String(look.time_s);
    document.body.dataset["end"] = look.outcome === "charging" ? "" : look.outcome;
  };

  const work = (of: number) => {
    if (of !== run) {
      return;
    }
    const begin_ms = performance.now();
    const factor = Number(select("speed").value);
    const passed_s = Math.min(begin_ms - last_ms, 250) / 1000;
    owed_s = Number.isFinite(factor) ? Math.min(owed_s + passed_s * factor, 250) : Infinity;
    last_ms = begin_ms;
    let goesOn = true;
    while (goesOn && owed_s >= data.period_s && performance.now() - begin_ms < WORK_MS) {
      const periods = Math.min(PERIODS_AT_ONCE, Math.floor(owed_s / data.period_s));
      goesOn = pack.advance(periods);
      owed_s -= periods * data.period_s;
    }
    show();
    if (goesOn) {
      setTimeout(() => work(of), 5);
    }
  };

  const begin = () => {
    const cells = select("cells").value;
    const bytes = Uint8Array.from(atob(data.packs[cells]!), (letter) => letter.charCodeAt(0));
    pack = new Pack(module, bytes, Number(cells), database.choices["ActiveConstraint"]!);
    chosen = null;
    tiles = pack.look().cells.map((_, i) => {
      const tile = element("button", { type: "button" }, element("span", {}, `cell ${i + 1}`), element("b"));
      const choose = () => {
        chosen = i;
        show();
      };
      tile.addEventListener("focus", choose);
      tile.addEventListener("pointerenter", choose);
      return tile;
    });
    byId("heat").replaceChildren(...tiles.map((tile) => element("li", {}, tile)));
    owed_s = 0;
    last_ms = performance.now();
    run++;
    document.body.dataset["run"] = String(run);
    work(run);
  };
  byId("restart").addEventListener("click", begin);
  select("cells").addEventListener("change", begin);
  select("shown").addEventListener("change", show);
  begin();
}

main().catch((error: unknown) => {
  byId("message").hidden = false;
  setText(byId("message"), String(error));
});
