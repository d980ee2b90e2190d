// What is known now: readings against their limits, decision, faults, traffic.

import type { Codecs, Values } from "./codec";
import type { Limits } from "./data";
import { byId, element, setText } from "./dom";
import type { Snapshot } from "./session";

const NOTHING = "n/a";

interface Reading {
  label: string;
  value: (snapshot: Snapshot) => number | null;
  digits: number;
  unit: string;
  idle: number; // where its bar begins
  limit: (limits: Limits) => number;
  more?: (snapshot: Snapshot) => string;
  needsTruth?: boolean;
}

const signal = (name: string, scale = 1) => (snapshot: Snapshot) => {
  const value = snapshot.readings[name] ?? null;
  return value === null ? null : scale * value;
};

const READINGS: Reading[] = [
  {
    label: "Current",
    value: signal("Current"),
    digits: 2,
    unit: "A",
    idle: 0,
    limit: (limits) => limits.reference_A,
    more: (snapshot) => `commanded ${text(snapshot.readings["CommandCurrent"], 2, "A")}`,
  },
  { label: "Voltage", value: signal("Voltage"), digits: 3, unit: "V", idle: 2, limit: (l) => l.voltage_V },
  {
    label: "State of charge",
    value: signal("StateOfCharge", 100),
    digits: 1,
    unit: "%",
    idle: 0,
    limit: (limits) => 100 * limits.soc,
    more: (snapshot) => `full in ${timeToFull(snapshot)}`,
  },
  {
    label: "Surface",
    value: signal("SurfaceTemperature"),
    digits: 2,
    unit: "K",
    idle: 273,
    limit: (limits) => limits.surface_K,
    more: (snapshot) => `coolant ${text(snapshot.readings["CoolantTemperature"], 1, "K")}`,
  },
  {
    label: "Core, estimated",
    value: signal("CoreTemperature"),
    digits: 2,
    unit: "K",
    idle: 273,
    limit: (limits) => limits.core_K,
    more: (snapshot) => `± ${text(snapshot.readings["ErrorBound"], 2, "K")}`,
  },
  {
    label: "Core, true",
    value: (snapshot) => snapshot.truth?.core_K ?? null,
    digits: 2,
    unit: "K",
    idle: 273,
    limit: (limits) => limits.core_K,
    more: (snapshot) =>
      snapshot.truth === null ? "" : `highest ${text(snapshot.truth.peak.core_K, 2, "K")}`,
    needsTruth: true,
  },
];

const MARGINS: Record<string, { signal: string; unit: string; digits: number }> = {
  voltage: { signal: "VoltageMargin", unit: "V", digits: 3 },
  soc: { signal: "SocMargin", unit: "1/s", digits: 4 },
  core: { signal: "CoreMargin", unit: "K/s", digits: 3 },
  surface: { signal: "SurfaceMargin", unit: "K/s²", digits: 3 },
};

function text(value: number | null | undefined, digits: number, unit: string): string {
  return value === null || value === undefined ? NOTHING : `${value.toFixed(digits)} ${unit}`;
}

export function duration(time_s: number): string {
  if (time_s < 100) {
    return `${time_s.toFixed(1)} s`;
  }
  const minutes = Math.floor(time_s / 60);
  return `${minutes} min ${String(Math.floor(time_s % 60)).padStart(2, "0")} s`;
}

/** As the firmware predicts it. */
function timeToFull(snapshot: Snapshot): string {
  const left_s = snapshot.readings["PredictedTimeToFull"];
  return left_s === null || left_s === undefined ? NOTHING : duration(left_s);
}

/** Cards of the readings, each with a bar from an idle value to the limit. */
export class ReadingCards {
  private readonly cards: { reading: Reading; value: Element; more: Element; bar: HTMLElement }[];

  constructor(isSimulation: boolean) {
    this.cards = READINGS.filter((reading) => isSimulation || reading.needsTruth !== true).map(
      (reading) => ({
        reading,
        value: element("strong", {}, NOTHING),
        more: element("span", { class: "muted" }),
        bar: element("span", { class: "bar" }),
      }),
    );
    byId("readings").replaceChildren(
      ...this.cards.map(({ reading, value, more, bar }) =>
        element(
          "div",
          { class: "reading", role: "group", "aria-label": reading.label },
          element("span", { class: "label" }, reading.label),
          value,
          element("span", { class: "track", "aria-hidden": "true" }, bar),
          more,
        ),
      ),
    );
  }

  show(snapshot: Snapshot, limits: Limits | null): void {
    for (const { reading, value, more, bar } of this.cards) {
      const now = reading.value(snapshot);
      setText(value, text(now, reading.digits, reading.unit));
      const limit = limits === null ? null : reading.limit(limits);
      const parts = [
        limit === null ? "limit unknown" : `limit ${Number(limit.toFixed(3))} ${reading.unit}`,
        reading.more?.(snapshot) ?? "",
      ];
      setText(more, parts.filter((part) => part !== "").join(" · "));
      const share =
        now === null || limit === null ? 0 : (now - reading.idle) / (limit - reading.idle);
      bar.style.width = `${100 * Math.min(Math.max(share, 0), 1)}%`;
      bar.classList.toggle("near", share > 0.97);
      bar.classList.toggle("over", share > 1);
    }
  }
}

function list(id: string, entries: [string, string, string?][]): void {
  const place = byId(id);
  const terms = [...place.querySelectorAll("dt")].map((term) => term.textContent);
  if (terms.join() !== entries.map(([term]) => term).join()) {
    place.replaceChildren(
      ...entries.flatMap(([term]) => [element("dt", {}, term), element("dd")]),
    );
  }
  const places = [...place.querySelectorAll("dd")];
  entries.forEach(([, value, kind], i) => {
    setText(places[i]!, value);
    places[i]!.className = kind ?? "";
  });
}

export function showDecision(snapshot: Snapshot, codecs: Codecs): void {
  const { readings } = snapshot;
  const constraint = codecs.choice("ActiveConstraint", readings["ActiveConstraint"]);
  const governing = MARGINS[constraint ?? ""];
  const margin =
    governing === undefined
      ? ""
      : `, margin ${text(readings[governing.signal], governing.digits, governing.unit)}`;
  const margins = Object.entries(MARGINS).map(
    ([name, { signal: of, unit, digits }]): [string, string] => [
      `margin, ${name}`,
      text(readings[of], digits, unit),
    ],
  );
  list("decision", [
    ["governs", `${constraint ?? NOTHING}${margin}`, governing === undefined ? "" : "strong"],
    ["admitted", admitted(readings)],
    ...margins,
    ["planned", text(readings["PlannedCurrent"], 2, "A")],
    ["full in", timeToFull(snapshot)],
    ["estimate", readings["InDomain"] === 0 ? "outside its domain" : "in its domain"],
    ...beside(snapshot),
  ]);
}

function admitted(readings: Values): string {
  const low = readings["LowerCurrent"] ?? null;
  const high = readings["UpperCurrent"] ?? null;
  return low === null || high === null ? NOTHING : `${low.toFixed(2)} … ${high.toFixed(2)} A`;
}

function beside(snapshot: Snapshot): [string, string, string?][] {
  const other = snapshot.beside;
  if (other === null) {
    return [];
  }
  const time = other.full_s === null ? "charging" : `full after ${duration(other.full_s)}`;
  return [["S-CBF", `${time}, core up to ${text(other.truth.peak.core_K, 2, "K")}`]];
}

export function showFaults(snapshot: Snapshot, codecs: Codecs): void {
  const named = (names: string[] | null) =>
    names === null ? NOTHING : names.length === 0 ? "none" : names.join(", ");
  const bad = (names: string[] | null) => ((names?.length ?? 0) > 0 ? "bad" : "");
  const number = snapshot.readings["FirstFault"] ?? null;
  const first = number === null ? NOTHING : (codecs.database.faults[number] ?? "none");
  list("faults", [
    ["active", named(snapshot.active), bad(snapshot.active)],
    ["latched", named(snapshot.latched), bad(snapshot.latched)],
    ["first", first],
    ...(snapshot.truth === null
      ? []
      : [
          [
            "limits",
            snapshot.violations.length === 0 ? "every one kept" : snapshot.violations.join("; "),
            snapshot.violations.length === 0 ? "good" : "bad",
          ] as [string, string, string],
        ]),
  ]);
}

export function showTraffic(snapshot: Snapshot): void {
  const body = byId("traffic").querySelector("tbody")!;
  const heard = snapshot.messages.filter((one) => one.age_s !== null || one.refused > 0);
  const names = [...body.rows].map((row) => row.cells[0]!.textContent);
  if (names.join() !== heard.map(({ name }) => name).join()) {
    body.replaceChildren(
      ...heard.map(({ name }) =>
        element("tr", {}, element("th", { scope: "row" }, name), element("td"), element("td")),
      ),
    );
  }
  heard.forEach((one, i) => {
    const row = body.rows[i]!;
    setText(row.cells[1]!, one.is_stale ? "stale" : one.rate_per_s.toFixed(1));
    setText(row.cells[2]!, String(one.refused));
    row.className = one.is_stale || one.refused > 0 ? "bad" : "";
  });
  setText(byId("frames"), `${snapshot.frames} frames, ${snapshot.foreign} of them foreign`);
}
