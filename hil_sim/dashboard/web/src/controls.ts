// What can be touched of a simulated charge.

import type { PresetData } from "./data";
import { byId } from "./dom";
import type { Start } from "./native";
import type { Mode, Request } from "./session";

export const SPEEDS: [string, number][] = [
  ["real time", 1],
  ["10 times", 10],
  ["100 times", 100],
  ["as fast as it goes", Infinity],
];
const FIRST_SPEED = 100;

const input = (id: string) => byId<HTMLInputElement>(id);
const select = (id: string) => byId<HTMLSelectElement>(id);

function showValue(of: HTMLInputElement): void {
  const output = document.querySelector<HTMLOutputElement>(`output[for="${of.id}"]`);
  const unit = of.dataset["unit"] ?? "";
  if (output !== null) {
    output.value = `${of.value} ${unit}`;
  }
  of.setAttribute("aria-valuetext", `${of.value} ${unit}`);
}

function setRange(id: string, low: number, high: number, value: number): void {
  const range = input(id);
  range.min = String(low);
  range.max = String(high);
  range.value = String(value);
  showValue(range);
}

export interface Listener {
  begin(): void;
  request(request: Request): void;
  pause(isPaused: boolean): void;
  speed(factor: number): void;
  beside(isOn: boolean): void;
  preset(name: string): void;
  save(): void;
}

export class Controls {
  constructor(
    presets: readonly string[],
    private readonly listener: Listener,
  ) {
    select("speed").replaceChildren(
      ...SPEEDS.map(([name, factor]) => new Option(name, String(factor), false, factor === FIRST_SPEED)),
    );
    select("preset").replaceChildren(...presets.map((name) => new Option(name, name)));
    for (const range of document.querySelectorAll<HTMLInputElement>('input[type="range"]')) {
      range.addEventListener("input", () => showValue(range));
      showValue(range);
    }
    byId("restart").addEventListener("click", () => listener.begin());
    byId("pause").addEventListener("click", () => this.setPaused(!this.isPaused, true));
    byId("save").addEventListener("click", () => listener.save());
    select("speed").addEventListener("change", () => listener.speed(this.speed));
    select("preset").addEventListener("change", () => listener.preset(select("preset").value));
    input("beside").addEventListener("change", () => listener.beside(this.isBeside));
    for (const id of ["mode", "full-by", "reference", "cooling"]) {
      byId(id).addEventListener("input", () => {
        this.showMode();
        listener.request(this.request);
      });
    }
    this.showMode();
  }

  get speed(): number {
    return Number(select("speed").value);
  }

  get isBeside(): boolean {
    return input("beside").checked;
  }

  get isPaused(): boolean {
    return byId("pause").getAttribute("aria-pressed") === "true";
  }

  setPaused(isPaused: boolean, isTold = false): void {
    byId("pause").setAttribute("aria-pressed", String(isPaused));
    byId("pause").textContent = isPaused ? "Go on" : "Pause";
    if (isTold) {
      this.listener.pause(isPaused);
    }
  }

  get request(): Request {
    return {
      mode: select("mode").value as Mode,
      reference_A: -input("reference").valueAsNumber,
      full_by_s: input("full-by").valueAsNumber,
      cooling_W: this.exact("cooling"),
    };
  }

  get start(): Start {
    const seed = Math.trunc(input("seed").valueAsNumber);
    return {
      seed: seed >= 0 && seed < 2 ** 32 ? seed : 0,
      soc: this.exact("soc", 100),
      temperature_K: this.exact("temperature"),
      cooling_power_W: this.exact("cooling"),
      resistance_factor: input("resistance").valueAsNumber / 100,
      capacity_factor: input("capacity").valueAsNumber / 100,
    };
  }

  /** Shows what a preset begins with, and how far it may be moved. */
  setPreset(preset: PresetData): void {
    const { initial, limits } = preset;
    input("reference").step = String(-limits.reference_A / 100);
    setRange("reference", 0, -limits.reference_A, -limits.reference_A);
    setRange("cooling", preset.cooling_power_W.low, preset.cooling_power_W.high, 0);
    setRange("soc", 0, 95, 0);
    setRange("temperature", preset.temperature_K.low, preset.temperature_K.high, 0);
    this.setStart(initial);
  }

  setStart(start: { soc: number; temperature_K: number; cooling_power_W: number }): void {
    this.put("cooling", start.cooling_power_W, 1);
    this.put("soc", start.soc, 100);
    this.put("temperature", start.temperature_K, 1);
  }

  setMode(mode: Mode): void {
    select("mode").value = mode;
    this.showMode();
  }

  /** A slider has steps; the exact value stays until somebody moves it. */
  private put(id: string, value: number, scale: number): void {
    const range = input(id);
    range.value = String(value * scale);
    range.dataset["exact"] = String(value);
    range.dataset["shown"] = range.value;
    showValue(range);
  }

  private exact(id: string, scale = 1): number {
    const range = input(id);
    const isUntouched = range.dataset["shown"] === range.value;
    return isUntouched ? Number(range.dataset["exact"]) : range.valueAsNumber / scale;
  }

  private showMode(): void {
    for (const part of document.querySelectorAll<HTMLElement>("[data-for]")) {
      part.hidden = part.dataset["for"] !== select("mode").value;
    }
  }
}
