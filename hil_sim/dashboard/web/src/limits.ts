// The limits of a preset as controls. They can only be lowered: its certificate, its model and the
// bound of its error are for what it allows. Python derives all that follows from a limit: a server when
// it is asked, or beforehand, for some values, into files.

import { fetchTightened, type LimitFiles, type Limits, type PresetData, type Tightened } from "./data";
import { byId, setText } from "./dom";

const REASON =
  "Tighter only: certificate, model and its error bound are for the preset's own. " +
  "The strongest current is part of the request.";

export interface LimitsListener {
  apply(tightened: Tightened): void;
  reset(name: string): void;
  save(file: string): void;
  refused(message: string): void;
}

export class LimitControls {
  private own: PresetData | null = null;
  private asked: Tightened | null = null; // until the firmware has taken it
  private file: string | null = null; // of the limits in force, where they are not the preset's

  constructor(
    private readonly files: LimitFiles | null,
    private readonly listener: LimitsListener,
  ) {
    byId("limits").addEventListener("submit", (event) => {
      event.preventDefault();
      void this.apply();
    });
    byId("own-limits").addEventListener("click", () => this.own && listener.reset(this.own.name));
    byId("save-preset").addEventListener("click", () => this.file && listener.save(this.file));
  }

  /** The preset as it ships, which is the loosest that can be had. */
  setPreset(preset: PresetData): void {
    this.own = preset;
    this.asked = null;
    this.loaded(preset);
  }

  /** What the firmware has taken: limits and their file are those now. */
  loaded(preset: PresetData): void {
    const isAsked = this.asked?.preset.preset_hash === preset.preset_hash;
    this.file = isAsked ? this.asked!.file : null;
    for (const input of this.inputs) {
      const name = input.dataset["limit"] as keyof Limits;
      input.max = String(this.own?.limits[name] ?? preset.limits[name]);
      input.value = String(preset.limits[name]);
    }
    byId("save-preset").hidden = this.file === null;
    setText(byId("limits-note"), this.note);
  }

  private get note(): string {
    if (this.file !== null) {
      return "A log of this run replays with the file: bms replay can.log --preset preset.toml";
    }
    return this.files === null ? REASON : `${REASON} ${this.filed}`;
  }

  /** What there are files of, in the words of the form. */
  private get filed(): string {
    const made = this.files?.[this.own?.name ?? ""] ?? {};
    const choices = Object.entries(made).map(
      ([limit, values]) => `${byId(limit).parentElement!.innerText.trim()} ${values.join(" or ")}`,
    );
    return `These files have one at a time: ${choices.join("; ")}. 'bms dashboard' makes any.`;
  }

  private get inputs(): HTMLInputElement[] {
    return [...document.querySelectorAll<HTMLInputElement>("input[data-limit]")];
  }

  private async apply(): Promise<void> {
    const own = this.own;
    if (own === null) {
      return;
    }
    const wanted = Object.fromEntries(
      this.inputs
        .filter((input) => input.valueAsNumber !== own.limits[input.dataset["limit"] as keyof Limits])
        .map((input) => [input.id, input.value]),
    );
    if (Object.keys(wanted).length === 0) {
      this.listener.reset(own.name);
      return;
    }
    try {
      this.asked = await fetchTightened(own.name, wanted, this.files);
      this.listener.apply(this.asked);
    } catch (error) {
      this.listener.refused(error instanceof Error ? error.message : String(error));
    }
  }
}
