// The course of a charge in four charts over one time axis.

import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { byId } from "./dom";
import type { Limits } from "./data";
import { HISTORY } from "./session";

const HEIGHT = 178;
const MOST_POINTS = 3000; // then every second one is dropped
const REDRAW_MS = 80;

type Column = (typeof HISTORY)[number];

interface Line {
  label: string;
  column: Column;
  colour: string; // name of a custom property
  dash?: number[];
  needs?: "simulation" | "beside";
}

interface Chart {
  title: string;
  digits: number;
  scale?: number;
  lines: Line[];
  limits: (limits: Limits) => { label: string; at: number }[];
}

const CHARTS: Chart[] = [
  {
    title: "Current, A",
    digits: 2,
    lines: [
      { label: "command", column: "command_A", colour: "--line-2" },
      { label: "current", column: "current_A", colour: "--line-1" },
      { label: "S-CBF", column: "beside_current_A", colour: "--line-4", dash: [4, 3], needs: "beside" },
    ],
    limits: (limits) => [{ label: "strongest", at: limits.reference_A }],
  },
  {
    title: "Temperature, K",
    digits: 2,
    lines: [
      { label: "surface", column: "surface_K", colour: "--line-3" },
      { label: "core, estimated", column: "estimate_K", colour: "--line-2" },
      { label: "core, true", column: "core_K", colour: "--line-1", needs: "simulation" },
      { label: "core, S-CBF", column: "beside_core_K", colour: "--line-4", dash: [4, 3], needs: "beside" },
    ],
    limits: (limits) => [{ label: "limit of the core", at: limits.core_K }],
  },
  {
    title: "Voltage, V",
    digits: 3,
    lines: [{ label: "voltage", column: "voltage_V", colour: "--line-1" }],
    limits: (limits) => [{ label: "limit", at: limits.voltage_V }],
  },
  {
    title: "State of charge, %",
    digits: 1,
    scale: 100,
    lines: [
      { label: "state of charge", column: "soc", colour: "--line-1" },
      { label: "S-CBF", column: "beside_soc", colour: "--line-4", dash: [4, 3], needs: "beside" },
    ],
    limits: (limits) => [{ label: "full", at: 100 * limits.completion_soc }],
  },
];

export class Charts {
  private readonly columns = new Map<Column, (number | null)[]>();
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
    this.empty();
    this.build();
  }

  clear(): void {
    this.empty();
    this.draw();
  }

  private empty(): void {
    HISTORY.forEach((name) => this.columns.set(name, []));
    this.stride = 1;
    this.seen = 0;
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

  /** Takes rows of HISTORY behind each other. */
  add(samples: Float64Array): void {
    for (let at = 0; at < samples.length; at += HISTORY.length) {
      if (this.seen++ % this.stride === 0) {
        HISTORY.forEach((name, i) => {
          const value = samples[at + i]!;
          this.columns.get(name)!.push(Number.isNaN(value) ? null : value);
        });
      }
    }
    while (this.columns.get("time_s")!.length > MOST_POINTS) {
      for (const [name, values] of this.columns) {
        this.columns.set(name, values.filter((_, i) => i % 2 === 0));
      }
      this.stride *= 2;
    }
    this.draw();
  }

  private draw(): void {
    if (!this.isDue) {
      this.isDue = true;
      setTimeout(() => {
        this.isDue = false;
        this.plots.forEach(({ plot, chart }) => plot.setData(this.data(chart)));
        byId("charts").dataset["points"] = String(this.columns.get("time_s")!.length);
      }, REDRAW_MS);
    }
  }

  private lines(chart: Chart): Line[] {
    return chart.lines.filter(
      ({ needs }) =>
        needs === undefined || (needs === "beside" ? this.isBeside : this.isSimulation),
    );
  }

  private data(chart: Chart): uPlot.AlignedData {
    const times = this.columns.get("time_s") as number[];
    const scale = chart.scale ?? 1;
    const lines = this.lines(chart).map(({ column }) => {
      const values = this.columns.get(column)!;
      return scale === 1 ? values : values.map((value) => value && scale * value);
    });
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
