// One charge: the plant, sensors and charger on one side of the bus, the ECU on the other. The order
// of a period is that of hil_sim/run/charge.py and hil_sim/nodes/plant.py, so that equal settings
// and seeds give equal frames.

import { candump } from "./candump";
import { decode, type Codecs, type Frame, type Values } from "./codec";
import type { Message, PresetData, Row } from "./data";
import { Fault, SENSORS } from "./faults";
import type { Native, Start, Truth } from "./native";
import { FaultRandom } from "./random";
import { Traffic } from "./traffic";
import { Trial, type Period, type Verdict } from "./verdict";

const OFF_PERIODS = 5;
const READY_PERIODS = 100;
const STARTING_PERIODS = 20_000;
const SILENT_PERIODS = 5;
const LONGEST_S = 4 * 3600;
const LONGEST_WAIT_PERIODS = 600; // of a fault for a current
const COOLING = SENSORS.indexOf("cooling_power_W");

export type Mode = "none" | "fastest" | "by-time" | "fixed";
const MODES: Record<Exclude<Mode, "none">, number> = { fastest: 0, "by-time": 1, fixed: 2 };

/** What the charger asks for; it may change while the charge runs. */
export interface Request {
  mode: Mode;
  reference_A: number; // strongest current wanted, negative
  full_by_s: number; // from the charge's start, for by-time
  cooling_W: number;
}

/** Columns of a period's row in the history. */
export const HISTORY = [
  "time_s",
  "current_A",
  "command_A",
  "voltage_V",
  "soc",
  "surface_K",
  "estimate_K",
  "core_K",
  "beside_current_A",
  "beside_core_K",
  "beside_soc",
] as const;

export interface Snapshot {
  time_s: number;
  charge_s: number | null; // since the charge's start
  end: string | null; // why the run is over
  readings: Values;
  active: string[] | null;
  latched: string[] | null;
  messages: import("./traffic").MessageTraffic[];
  frames: number;
  foreign: number;
  truth: Truth | null;
  beside: { truth: Truth; full_s: number | null; is_running: boolean } | null;
  verdicts: Verdict[];
  violations: string[];
}

export class Session {
  readonly log: string[] = [];
  end: string | null = null;
  private readonly traffic: Traffic;
  private readonly command: Message;
  private readonly sync: Frame;
  private steps = 0;
  private edge: number | null = null;
  private silent = 0;
  private current_A = 0;
  private unread: Frame[] = []; // behind a SYNC, for the next period
  private isDown = false;
  private healthy_W: number | null = null; // of the pump, while it has failed
  private faults: Fault[] = [];
  private trials: Trial[] = [];
  private planned: { row: Row; onset: number }[] = [];
  private beside: { is_running: boolean; periods: number; full_s: number | null } | null = null;
  private samples: number[] = []; // rows of HISTORY behind each other

  constructor(
    private readonly native: Native,
    private readonly codecs: Codecs,
    private readonly preset: PresetData,
    private readonly start: Start,
    public request: Request,
  ) {
    this.traffic = new Traffic(codecs);
    this.command = codecs.named("ChargeCommand");
    this.sync = { id: codecs.named("SYNC").id, data: new Uint8Array(0) };
    native.begin(start);
  }

  get time_s(): number {
    return this.steps * this.preset.period_s;
  }

  /** A fault acts as soon as it can, or from a period of the charge on, but not before a current
   * flows: a row is about a charge that does. */
  inject(row: Row, onset = 0): void {
    this.planned.push({ row, onset });
  }

  /** S-CBF charges the same cell from the same start beside the firmware, or no longer does. */
  setBeside(isOn: boolean): void {
    if (!isOn) {
      this.beside = null;
    } else if (this.beside === null) {
      this.native.beginBeside();
      this.beside = { is_running: true, periods: 0, full_s: null };
      for (let period = 0; period < this.steps; period++) {
        this.advanceBeside();
      }
      if (this.end !== null) {
        this.finishBeside();
      }
    }
  }

  setCooling(full_W: number): void {
    this.request.cooling_W = full_W;
    if (this.healthy_W === null) {
      this.native.cool(full_W);
    } else {
      this.healthy_W = full_W;
    }
  }

  /** Run one control period. */
  step(): void {
    const truth = this.native.look();
    this.plan();
    this.beginFaults(truth);
    const time_s = this.time_s;
    const sent = this.sent(this.published(this.measured(truth)));
    const answers = this.answered(sent);
    this.record(time_s, sent, false);
    this.record(time_s, answers, true);
    const heard = this.faults.reduce((frames, fault) => fault.frames(frames, true), answers);
    const usable_A = this.native.hear(heard);
    const obedient_A = this.native.obey(usable_A);
    this.current_A = this.faults.reduce(
      (current_A, fault) => fault.supplied_A(current_A, this.current_A),
      obedient_A,
    );
    this.native.supply(this.current_A);
    const told = this.native.told(this.command.length);
    const command = told === null ? null : decode(this.command, told);
    const state = this.codecs.choice("CommandState", command?.["CommandState"]);
    this.silent = command?.["CommandCurrent"] == null ? this.silent + 1 : 0;
    this.note(Number.isNaN(usable_A) ? null : usable_A, state, heard, command);
    this.steps++;
    this.end = this.reasonToStop(state);
    if (this.end === null) {
      this.prepare(state);
      this.native.advance();
      this.advanceBeside();
    } else {
      this.finishBeside();
    }
  }

  /** Rows of HISTORY behind each other, of what has been noted since the last call. */
  takeSamples(): Float64Array {
    const taken = Float64Array.from(this.samples);
    this.samples = [];
    return taken;
  }

  snapshot(): Snapshot {
    const truth = this.native.look();
    const violations = this.violations(truth);
    const names = (bits: bigint | null) =>
      bits === null
        ? null
        : this.codecs.database.faults.filter((_, n) => ((bits >> BigInt(n)) & 1n) !== 0n);
    return {
      time_s: this.time_s,
      charge_s: this.edge === null ? null : (this.steps - this.edge) * this.preset.period_s,
      end: this.end,
      readings: this.traffic.readings(),
      active: names(this.traffic.faults.active),
      latched: names(this.traffic.faults.latched),
      messages: this.traffic.messages(Math.max(0, this.time_s - this.preset.period_s)),
      frames: this.traffic.frames,
      foreign: this.traffic.foreign,
      truth,
      beside: this.beside && {
        truth: this.native.lookBeside(),
        full_s: this.beside.full_s,
        is_running: this.beside.is_running,
      },
      verdicts: this.trials.map((trial) =>
        trial.verdict(truth.soc, violations, this.end !== null),
      ),
      violations,
    };
  }

  private get chargePeriod(): number | null {
    return this.edge === null ? null : this.steps - this.edge;
  }

  /** A fault has to see the period before it, whose readings and frames some of them keep. */
  private plan(): void {
    const onset = (this.chargePeriod ?? -1) + 1;
    const isDue = (one: { onset: number }) =>
      onset > 0 &&
      onset >= one.onset &&
      (this.current_A < 0 || onset >= one.onset + LONGEST_WAIT_PERIODS);
    for (const { row } of this.planned.filter(isDue)) {
      const { period_s } = this.preset;
      const random = new FaultRandom(this.start.seed, this.faults.length);
      const fault = new Fault(row.fault, onset, this.codecs, period_s, random);
      this.faults.push(fault);
      const { faults } = this.codecs.database;
      const trial = new Trial(row, onset, fault.length, this.preset, faults);
      trial.isDisturbed = this.trials.some((other) => other.acts(onset));
      this.trials.filter((other) => !other.isOver).forEach((other) => (other.isDisturbed = true));
      this.trials.push(trial);
    }
    this.planned = this.planned.filter((one) => !isDue(one));
  }

  private isActive(kind: string): boolean {
    return this.faults.some((fault) => fault.isActive && fault.data.kind === kind);
  }

  private beginFaults(truth: Truth): void {
    for (const fault of this.faults) {
      fault.begin(this.chargePeriod);
    }
    const hasFailed = this.isActive("pump-failed");
    if (hasFailed && this.healthy_W === null) {
      this.healthy_W = truth.cooling_W;
      this.native.cool(0);
    } else if (!hasFailed && this.healthy_W !== null) {
      this.native.cool(this.healthy_W);
      this.healthy_W = null;
    }
  }

  private measured(truth: Truth): number[] {
    const healthy = this.native.measure();
    const isHidden = this.faults.some(
      (fault) =>
        fault.isActive &&
        fault.data.kind === "pump-failed" &&
        fault.data["reported"] === "healthy",
    );
    if (isHidden && this.healthy_W !== null) {
      healthy[COOLING]! += this.healthy_W;
    }
    return this.faults.reduce((readings, fault) => fault.readings(readings, truth), healthy);
  }

  private published(readings: number[]): Frame[] {
    const { mode, reference_A } = this.request;
    const values = [...readings, this.edge === null ? 0 : 1, reference_A, this.start.soc];
    if (mode !== "none") {
      values.push(MODES[mode], this.timeLeft_s());
    }
    return [...this.native.publish(values, mode !== "none"), this.sync];
  }

  private timeLeft_s(): number {
    if (this.request.mode !== "by-time") {
      return NaN;
    }
    return Math.max(0, this.request.full_by_s - (this.chargePeriod ?? 0) * this.preset.period_s);
  }

  private sent(frames: Frame[]): Frame[] {
    return this.faults.reduce((arriving, fault) => fault.frames(arriving, false), frames);
  }

  private answered(frames: Frame[]): Frame[] {
    const place = frames.findIndex((frame) => frame.id === this.sync.id);
    const taken = [...this.unread, ...frames.slice(0, place + 1)];
    this.unread = frames.slice(place + 1);
    const isDown = this.isActive("ecu-restarted");
    if (this.isDown && !isDown) {
      this.native.startEcu();
    }
    this.isDown = isDown;
    return isDown ? [] : this.native.exchange(taken);
  }

  private record(time_s: number, frames: readonly Frame[], isReceived: boolean): void {
    for (const frame of frames) {
      this.traffic.take(time_s, frame);
    }
    this.log.push(candump(time_s, frames, isReceived));
  }

  private note(
    usable_A: number | null,
    state: string | null,
    heard: readonly Frame[],
    command: Values | null,
  ): void {
    const truth = this.native.look();
    const readings = this.traffic.readings();
    const beside = this.beside === null ? null : this.native.lookBeside();
    this.samples.push(
      this.time_s,
      truth.current_A,
      command?.["CommandCurrent"] ?? NaN,
      truth.voltage_V,
      truth.soc,
      truth.surface_K,
      readings["CoreTemperature"] ?? NaN,
      truth.core_K,
      beside?.current_A ?? NaN,
      beside?.core_K ?? NaN,
      beside?.soc ?? NaN,
    );
    const period: Period = {
      usable_A,
      flowing_A: truth.current_A,
      state,
      latched: this.isHeard("Diagnostics", heard) ? (this.traffic.faults.latched ?? 0n) : 0n,
      constraint: this.codecs.choice("ActiveConstraint", readings["ActiveConstraint"]),
    };
    if (this.chargePeriod !== null) {
      this.trials.forEach((trial) => trial.note(this.chargePeriod!, period));
    }
  }

  private isHeard(name: string, heard: readonly Frame[]): boolean {
    const id = this.codecs.named(name).id;
    return heard.some((frame) => frame.id === id);
  }

  private prepare(state: string | null): void {
    if (this.edge !== null || this.steps < OFF_PERIODS) {
      return;
    }
    if (state === "standby") {
      this.edge = this.steps;
    } else if (this.steps >= (state === "init" ? STARTING_PERIODS : READY_PERIODS)) {
      this.end = `the ECU is not ready after ${this.steps} periods (state: ${state ?? "none"})`;
    }
  }

  private reasonToStop(state: string | null): string | null {
    const isAwaited = this.planned.length > 0 || this.trials.some((trial) => !trial.isOver);
    if (this.edge === null || isAwaited) {
      return this.isTooLong ? "time limit" : null;
    }
    if (this.silent >= SILENT_PERIODS) {
      return "no command";
    }
    if (state === "complete" || state === "fault") {
      return state;
    }
    return this.isTooLong ? "time limit" : null;
  }

  private get isTooLong(): boolean {
    return (this.chargePeriod ?? 0) * this.preset.period_s >= LONGEST_S;
  }

  private advanceBeside(): void {
    const beside = this.beside;
    if (beside === null || !beside.is_running) {
      return;
    }
    beside.is_running = this.native.advanceBeside();
    beside.periods++;
    if (!beside.is_running) {
      beside.full_s = Math.max(0, beside.periods - OFF_PERIODS - 1) * this.preset.period_s;
    }
  }

  /** Its time to full is worth knowing, also where it takes longer. */
  private finishBeside(): void {
    while (this.beside?.is_running === true) {
      this.advanceBeside();
    }
  }

  private violations(truth: Truth): string[] {
    const { limits } = this.preset;
    const checks: [string, number, number, string][] = [
      ["core temperature", truth.peak.core_K, limits.core_K, " K"],
      ["surface temperature", truth.peak.surface_K, limits.surface_K, " K"],
      ["voltage", truth.peak.voltage_V, limits.voltage_V, " V"],
      ["state of charge", truth.peak.soc, limits.soc, ""],
    ];
    return checks
      .filter(([, value, limit]) => !(value <= limit))
      .map(([name, value, limit, unit]) => `${name} ${value.toFixed(3)}${unit} above ${limit}${unit}`);
  }
}
