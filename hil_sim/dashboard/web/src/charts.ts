// The course of a charge in four charts over one time axis.

import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { byId } from "./dom";
import type { Limits } from "./data";
import { HISTORY, type Sample } from "./session";

const HEIGHT = 178;
const MOST_POINTS = 12_000;
const PLACE = Object.fromEntries(HISTORY.map((name, i) => [name, i])) as Record<
  (typeof HISTORY)[number],
  number
>;

interface Line {
  label: string;
  of: (sample: Sample) => number;
  colour: string; // name of a custom property
  dash?: number[];
  needs?: "simulation" | "beside";
}

interface Chart {
  title: string;
  digits: number;
  lines: Line[];
  limits: (limits: Limits) => { label: string; at: number }[];
}

const column = (name: (typeof HISTORY)[number], scale = 1) => (sample: Sample) =>
  scale * sample[PLACE[name]]!;

const CHARTS: Chart[] = [
  {
    title: "Current, A",
    digits: 2,
    lines: [
      { label: "command", of: column("command_A"), colour: "--line-2" },
      { label: "current", of: column("current_A"), colour: "--line-1" },
      { label: "S-CBF", of: column("beside_current_A"), colour: "--line-4", dash: [4, 3], needs: "beside" },
    ],
    limits: (limits) => [{ label: "strongest", at: limits.reference_A }],
  },
  {
    title: "Temperature, K",
    digits: 2,
    lines: [
      { label: "surface", of: column("surface_K"), colour: "--line-3" },
      { label: "core, estimated", of: column("estimate_K"), colour: "--line-2" },
      { label: "core, true", of: column("core_K"), colour: "--line-1", needs: "simulation" },
      { label: "core, S-CBF", of: column("beside_core_K"), colour: "--line-4", dash: [4, 3], needs: "beside" },
    ],
    limits: (limits) => [{ label: "limit of the core", at: limits.core_K }],
  },
  {
    title: "Voltage, V",
    digits: 3,
    lines: [{ label: "voltage", of: column("voltage_V"), colour: "--line-1" }],
    limits: (limits) => [{ label: "limit", at: limits.voltage_V }],
  },
  {
    title: "State of charge, %",
    digits: 1,
    lines: [
      { label: "state of charge", of: column("soc", 100), colour: "--line-1" },
      { label: "S-CBF", of: column("beside_soc", 100), colour: "--line-4", dash: [4, 3], needs: "beside" },
    ],
    limits: (limits) => [{ label: "full", at: 100 * limits.completion_soc }],
  },
];

export class Charts {
  private samples: Sample[] = [];
  private plots: { plot: uPlot; chart: Chart }[] = [];
  private stride = 1;
  private seen = 0;
  private isDue = false;
  private isBeside = false;

  constructor(
    private readonly isSimulation: boolean,
    private limits: Limits | null,
  ) {
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.build());
    new ResizeObserver(() => this.resize()).observe(byId("charts"));
    this.build();
  }

  clear(): void {
    this.samples = [];
    this.stride = 1;
    this.seen = 0;
    this.draw();
  }

  setLimits(limits: Limits | null): void {
    if (JSON.stringify(limits) !== JSON.stringify(this.limits)) {
      this.limits = limits;
      this.build();
    }
  }

  setBeside(isOn: boolean): void {
    if (isOn !== this.isBeside) {
      this.isBeside = isOn;
      this.build();
    }
  }

  add(samples: readonly Sample[]): void {
    for (const sample of samples) {
      if (this.seen++ % this.stride === 0) {
        this.samples.push(sample);
      }
    }
    if (this.samples.length > MOST_POINTS) {
      this.samples = this.samples.filter((_, i) => i % 2 === 0);
      this.stride *= 2;
    }
    this.draw();
  }

  private draw(): void {
    if (!this.isDue) {
      this.isDue = true;
      requestAnimationFrame(() => {
        this.isDue = false;
        this.plots.forEach(({ plot, chart }) => plot.setData(this.data(chart)));
      });
    }
  }

  private lines(chart: Chart): Line[] {
    return chart.lines.filter(
      ({ needs }) =>
        needs === undefined || (needs === "beside" ? this.isBeside : this.isSimulation),
    );
  }

  private data(chart: Chart): uPlot.AlignedData {
    const times = this.samples.map(column("time_s"));
    const lines = this.lines(chart).map(({ of }) =>
      this.samples.map((sample) => {
        const value = of(sample);
        return Number.isNaN(value) ? null : value;
      }),
    );
    const limits = (this.limits === null ? [] : chart.limits(this.limits)).map(({ at }) =>
      times.map(() => at),
    );
    return [times, ...lines, ...limits];
  }

  private build(): void {
    const style = getComputedStyle(document.documentElement);
    const colour = (name: string) => style.getPropertyValue(name).trim();
    const place = byId("charts");
    place.replaceChildren();
    const axis = { stroke: colour("--muted"), grid: { stroke: colour("--grid"), width: 1 }, ticks: { show: false } };
    this.plots = CHARTS.map((chart) => {
      const box = document.createElement("figure");
      box.setAttribute("role", "img");
      box.setAttribute("aria-label", `${chart.title.split(",")[0]} over time`);
      place.append(box);
      const limits = this.limits === null ? [] : chart.limits(this.limits);
      const shown = (_: uPlot, value: number | null) =>
        value === null ? "–" : value.toFixed(chart.digits);
      const plot = new uPlot(
        {
          title: chart.title,
          width: box.clientWidth || 300,
          height: HEIGHT,
          cursor: { sync: { key: "time" }, drag: { x: false, y: false } },
          scales: { x: { time: false } },
          axes: [
            { ...axis, size: 28, values: (_, ticks) => ticks.map((tick) => `${tick} s`) },
            { ...axis, size: 52 },
          ],
          series: [
            { label: "time", value: (_, value) => (value === null ? "–" : `${value.toFixed(1)} s`) },
            ...this.lines(chart).map((line) => ({
              label: line.label,
              stroke: colour(line.colour),
              width: 1.5,
              dash: line.dash ?? [],
              points: { show: false },
              value: shown,
            })),
            ...limits.map(({ label }) => ({
              label,
              stroke: colour("--limit"),
              width: 1,
              dash: [6, 4],
              points: { show: false },
              value: shown,
            })),
          ],
        },
        this.data(chart),
        box,
      );
      return { plot, chart };
    });
  }

  private resize(): void {
    for (const { plot } of this.plots) {
      const width = plot.root.parentElement?.clientWidth ?? 0;
      if (width > 0 && width !== plot.width) {
        plot.setSize({ width, height: HEIGHT });
      }
    }
  }
}
