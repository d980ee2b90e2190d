// Whether a fault went as its row of the matrix expects. As hil_sim/fault_matrix/verdict.py.

import type { PresetData, Row } from "./data";

const SHARE = 0.2; // of the current, by which a charger of the matrix misses its command
const PERIODS = 10; // within which a current that does not follow its command is found

/** What is kept of a period. */
export interface Period {
  usable_A: number | null; // null: no command that a charger may use
  flowing_A: number;
  state: string | null;
  latched: bigint; // 0 where the ECU says nothing
  constraint: string | null;
}

export interface Verdict {
  row: string;
  expected: string;
  seen: string;
  outcome: "running" | "passed" | "failed" | "does not apply";
  remarks: string[];
}

const plural = (count: number, noun: string) => `${count} ${noun}${count === 1 ? "" : "s"}`;

/** What the row demands, in words. */
export function expectation(row: Row): string {
  const expect = row.expect;
  const by = expect.deadline_periods === null ? "" : ` within ${plural(expect.deadline_periods, "period")}`;
  const parts = {
    stops: `0 A${by} and for good, then state ${expect.state}`,
    resumes: `0 A${by}, current again ${plural(expect.resumes_periods ?? 1, "period")} after it`,
    restrains: `less current than before${by}`,
    "rides-through": "the current goes on",
  };
  const latch =
    expect.latches === null
      ? "no fault latches"
      : `${expect.latches} latches within ${plural(expect.latch_deadline_periods ?? 1, "period")}`;
  return `${parts[expect.reaction]}; ${latch}`;
}

/** Number of the first period in which a condition holds, from `first` on; 1 is the fault's first. */
function numberOf(periods: readonly Period[], holds: (p: Period) => boolean, first = 1) {
  for (let number = Math.max(1, first); number <= periods.length; number++) {
    if (holds(periods[number - 1]!)) {
      return number;
    }
  }
  return null;
}

const isZero = (p: Period) => (p.usable_A === null || p.usable_A === 0) && p.flowing_A === 0;

function reactionFailures(row: Row, periods: Period[], before_A: number, end: number): string[] {
  const { reaction, deadline_periods, resumes_periods, state } = row.expect;
  const deadline = deadline_periods ?? 1;
  switch (reaction) {
    case "stops": {
      const late = numberOf(periods, (p) => !isZero(p), deadline);
      const last = periods.findLast((p) => p.state !== null)?.state ?? null;
      return [
        ...(late === null ? [] : [`${amperes(periods[late - 1]!)} in period ${late}`]),
        ...(last === null || last === state ? [] : [`state ${last} at the end, not ${state}`]),
      ];
    }
    case "resumes": {
      const isLate = deadline_periods !== null && !periods.slice(0, deadline).some(isZero);
      const gap = numberOf(periods, (p) => !(p.flowing_A < 0), end + (resumes_periods ?? 1));
      return [
        ...(isLate ? [`never 0 A up to period ${deadline}`] : []),
        ...(gap === null ? [] : [`no current again in period ${gap}`]),
      ];
    }
    case "restrains": {
      const late = numberOf(periods, (p) => p.flowing_A <= before_A, deadline);
      return late === null ? [] : [`${amperes(periods[late - 1]!)} in period ${late}, no less than before`];
    }
    case "rides-through": {
      const gap = numberOf(periods, (p) => !(p.flowing_A < 0));
      return gap === null ? [] : [`no current in period ${gap}`];
    }
  }
}

function amperes(period: Period): string {
  const told = period.usable_A === null ? "no command" : `${period.usable_A.toFixed(2)} A commanded`;
  return `${told}, ${period.flowing_A.toFixed(2)} A flowing`;
}

function latchFailures(row: Row, periods: Period[], faults: readonly string[]): string[] {
  const { latches, latch_deadline_periods } = row.expect;
  if (latches === null) {
    const number = numberOf(periods, (p) => p.latched !== 0n);
    return number === null ? [] : [`a fault latched in period ${number}`];
  }
  const bit = 1n << BigInt(faults.indexOf(latches));
  const number = numberOf(periods, (p) => (p.latched & bit) !== 0n);
  if (number === null) {
    return [`${latches} never latched`];
  }
  const deadline = latch_deadline_periods ?? 1;
  return number > deadline ? [`${latches} latched in period ${number}, not by ${deadline}`] : [];
}

/** Why the row says nothing here; null where it applies. As hil_sim/fault_matrix/needs.py. */
function unmet(row: Row, preset: PresetData, before: Period, soc: number): string | null {
  const strength_A = -before.flowing_A;
  for (const need of row.needs) {
    if (need === "known-cell" && preset.is_family) {
      return "the preset is a family of cells, for which this reading may be right";
    }
    if (need === "temperature-limited" && !["core", "surface"].includes(before.constraint ?? "")) {
      return "no temperature limited the current before the fault";
    }
    if (need === "time-to-fill" && soc < preset.limits.completion_soc) {
      return "the cell was not full at the end";
    }
    if (need === "strong-current" && SHARE * strength_A < 2 * preset.permitted_A) {
      return "the current before the fault was too weak for a clear deviation";
    }
    if (need === "growing-current" && PERIODS * preset.growth_A < 2 * preset.permitted_A) {
      return "the current of this preset grows too slowly for a clear deviation";
    }
  }
  return null;
}

/** A fault that acts, with what has been seen since. */
export class Trial {
  private readonly periods: Period[] = [];
  private before: Period | null = null;
  /** Another fault acts or has acted, so that what is seen may be of that. */
  isDisturbed = false;

  constructor(
    readonly row: Row,
    readonly onset: number, // the fault's first period
    private readonly length: number, // of the fault, in periods
    private readonly preset: PresetData,
    private readonly faults: readonly string[],
  ) {}

  /** Whether enough has been seen to judge. */
  get isOver(): boolean {
    return this.periods.length >= this.row.after_periods;
  }

  /** Whether the fault, or what it has led to, is not over in a period. */
  acts(chargePeriod: number): boolean {
    return (
      !this.isOver ||
      chargePeriod < this.onset + this.length ||
      this.periods.some((period) => period.latched !== 0n)
    );
  }

  note(chargePeriod: number, period: Period): void {
    if (chargePeriod < this.onset) {
      this.before = period;
    } else if (!this.isOver) {
      this.periods.push(period);
    }
  }

  verdict(soc: number, violations: readonly string[], hasEnded: boolean): Verdict {
    const { row, periods, before } = this;
    const end = Number.isFinite(this.length) ? this.length : periods.length;
    const isFlowing = (before?.flowing_A ?? 0) < 0;
    const reaction = [
      ...reactionFailures(row, periods, before?.flowing_A ?? 0, end),
      ...latchFailures(row, periods, this.faults),
    ];
    const reason =
      reaction.length > 0 && isFlowing && before !== null ? this.doubt(before, soc) : null;
    const failures = [
      ...(isFlowing ? [] : ["no current flowed before the fault"]),
      ...(reason === null ? reaction : []),
      ...violations,
    ];
    const isDecided = this.isOver || hasEnded;
    const decided =
      failures.length > 0 ? "failed" : reason !== null ? "does not apply" : "passed";
    return {
      row: row.name,
      expected: expectation(row),
      seen: this.seen(),
      outcome: isDecided ? decided : "running",
      remarks: isDecided ? [...failures, ...(reason === null ? [] : [reason])] : [],
    };
  }

  private doubt(before: Period, soc: number): string | null {
    return this.isDisturbed
      ? "another fault acts in this charge"
      : unmet(this.row, this.preset, before, soc);
  }

  private seen(): string {
    const periods = this.periods;
    const last = periods.at(-1);
    if (last === undefined) {
      return "not yet";
    }
    const zero = numberOf(periods, isZero);
    const latch = numberOf(periods, (p) => p.latched !== 0n);
    const bits = periods.reduce((all, p) => all | p.latched, 0n);
    const names = this.faults.filter((_, n) => ((bits >> BigInt(n)) & 1n) !== 0n);
    const state = periods.findLast((p) => p.state !== null)?.state ?? "unknown";
    return [
      zero === null ? "never 0 A" : `0 A in period ${zero}`,
      latch === null ? "nothing latched" : `${names.join(", ")} latched in period ${latch}`,
      `state ${state}, ${Math.abs(last.flowing_A).toFixed(1)} A after ${plural(periods.length, "period")}`,
    ].join("; ");
  }
}
