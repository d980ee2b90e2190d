// The page: a simulated charge in a worker, or a running bus; one view for both.

import { Charts } from "./charts";
import { Codecs } from "./codec";
import { Controls } from "./controls";
import { fetchData, type Config, type Database, type Limits, type PresetData, type Row } from "./data";
import { byId, setText } from "./dom";
import { listen, LiveClock } from "./feed";
import { LimitControls } from "./limits";
import { Matrix } from "./matrix";
import type { FromWorker, ToWorker } from "./messages";
import { duration, ReadingCards, showDecision, showFaults, showTraffic } from "./panels";
import { HISTORY, type Snapshot } from "./session";
import "./style.css";

function tell(message: string): void {
  const place = byId("message");
  place.hidden = message === "";
  setText(place, message);
}

/** What both sources are shown by. */
class View {
  private readonly cards: ReadingCards;
  readonly charts: Charts;

  constructor(
    private readonly codecs: Codecs,
    isSimulation: boolean,
    private limits: Limits | null,
  ) {
    this.cards = new ReadingCards(isSimulation);
    this.charts = new Charts(isSimulation, limits);
  }

  setLimits(limits: Limits | null): void {
    this.limits = limits;
    this.charts.setLimits(limits);
  }

  show(snapshot: Snapshot): void {
    const { readings } = snapshot;
    const told = readings["DiagnosticState"] ?? readings["CommandState"];
    const state = this.codecs.choice("DiagnosticState", told) ?? "no ECU heard";
    setText(byId("state"), state);
    byId("state").dataset["state"] = state;
    setText(byId("clock"), duration(snapshot.charge_s ?? snapshot.time_s));
    this.cards.show(snapshot, this.limits);
    showDecision(snapshot, this.codecs);
    showFaults(snapshot, this.codecs);
    showTraffic(snapshot);
  }
}

function save(lines: readonly string[], name: string): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob(lines as string[], { type: "text/plain" }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

async function simulate(config: Config, database: Database): Promise<void> {
  const [preset, module] = await Promise.all([
    fetchData<PresetData>(`data/${config.presets[0]!}.json`),
    fetch("page.wasm").then(async (answer) => WebAssembly.compile(await answer.arrayBuffer())),
  ]);
  const worker = new Worker(new URL("./worker.ts", import.meta.url), { type: "module" });
  const post = (message: ToWorker) => worker.postMessage(message);
  const view = new View(new Codecs(database), true, preset.limits);
  let run = 0;

  const begin = (row?: Row) => {
    controls.setPaused(false);
    tell("");
    const { start, request, isBeside } = controls;
    view.charts.clear();
    view.charts.setBeside(isBeside);
    post({ type: "begin", start, request, isBeside, ...(row === undefined ? {} : { row }) });
    post({ type: "run", isRunning: true });
  };
  const load = async (chosen: PresetData) => {
    controls.setPreset(chosen);
    limits.setPreset(chosen);
    post({ type: "load", module, database, preset: chosen });
    begin();
    matrix.setRows(await fetchData<Row[]>(`data/${chosen.name}.rows.json`));
  };
  const loadAgain = (chosen: PresetData) => post({ type: "load", module, database, preset: chosen });
  const guarded = (work: Promise<void>) => {
    work.catch((error: unknown) => tell(String(error)));
  };
  const controls = new Controls(config.presets, {
    begin,
    request: (request) => post({ type: "request", request }),
    pause: (isPaused) => post({ type: "run", isRunning: !isPaused }),
    speed: (factor) => post({ type: "speed", factor }),
    beside: (isOn) => {
      view.charts.setBeside(isOn);
      post({ type: "beside", isOn });
    },
    preset: (name) => guarded(fetchData<PresetData>(`data/${name}.json`).then(load)),
    save: () => post({ type: "log" }),
  });
  let rowsOf: { preset: PresetData; rows: Row[] } | null = null; // that the firmware is asked to take
  const limits = new LimitControls(config.limits, {
    apply: ({ preset: chosen, rows }) => {
      rowsOf = { preset: chosen, rows };
      loadAgain(chosen);
    },
    reset: (name) => guarded(fetchData<PresetData>(`data/${name}.json`).then(load)),
    save: (file) => save([file], "preset.toml"),
    refused: (message) => tell(`${message}; the limits before stay in force`),
  });
  const matrix = new Matrix((row, isFromItsStart) => {
    if (!isFromItsStart) {
      post({ type: "inject", row });
      return;
    }
    controls.setStart(row.start);
    controls.setMode("fixed");
    begin(row);
  });

  worker.addEventListener("message", ({ data }: MessageEvent<FromWorker>) => {
    switch (data.type) {
      case "snapshot":
        if (data.run !== run) {
          run = data.run;
          view.charts.clear();
        }
        view.charts.add(data.samples);
        view.show(data.snapshot);
        matrix.show(data.snapshot.verdicts);
        document.body.dataset["run"] = String(run);
        document.body.dataset["end"] = data.snapshot.end ?? "";
        setText(byId("footer"), data.snapshot.end === null ? "" : `The run is over: ${data.snapshot.end}.`);
        break;
      case "loaded":
        view.setLimits(data.preset.limits);
        setText(byId("source"), `${data.preset.name}, simulated in this page`);
        limits.loaded(data.preset);
        if (rowsOf?.preset.preset_hash === data.preset.preset_hash) {
          matrix.setRows(rowsOf.rows);
          begin();
        }
        rowsOf = null;
        break;
      case "log":
        save(data.lines, "can.log");
        break;
      case "error":
        rowsOf = null;
        tell(data.message);
        break;
    }
  });
  worker.addEventListener("error", (event) => tell(`the worker has failed: ${event.message}`));
  post({ type: "speed", factor: controls.speed });
  await load(preset);
}

function watchBus(bus: string, database: Database): void {
  const view = new View(new Codecs(database), false, null);
  setText(byId("source"), `${bus}, listened to only`);
  const row = (...known: number[]) =>
    view.charts.add(Float64Array.from([...known, ...HISTORY.slice(known.length).map(() => NaN)]));
  const clock = new LiveClock();
  listen({
    snapshot: (snapshot, limits, remark) => {
      const { time_s, gap_s } = clock.read(snapshot.time_s);
      tell(remark);
      if (limits !== null) {
        view.setLimits(limits); // those of before stay while the ECU has not told who it is
      }
      view.show(snapshot);
      if (gap_s !== null) {
        row(gap_s);
      }
      const value = (name: string) => snapshot.readings[name] ?? NaN;
      row(
        time_s,
        value("Current"),
        value("CommandCurrent"),
        value("Voltage"),
        value("StateOfCharge"),
        value("SurfaceTemperature"),
        value("CoreTemperature"),
      );
    },
    lost: (message, wait_s) => {
      clock.lose();
      setText(byId("state"), "no feed");
      byId("state").dataset["state"] = "lost";
      tell(`${message}; connecting again in ${wait_s} s`);
    },
  });
}

async function main(): Promise<void> {
  const [config, database] = await Promise.all([
    fetchData<Config>("data/config.json"),
    fetchData<Database>("data/database.json"),
  ]);
  const isBus = config.bus !== null && !location.hash.includes("simulation");
  document.body.dataset["source"] = isBus ? "bus" : "simulation";
  for (const part of document.querySelectorAll<HTMLElement>("[data-simulation]")) {
    part.hidden = isBus;
  }
  if (isBus) {
    watchBus(config.bus!, database);
  } else {
    await simulate(config, database);
  }
}

main().catch((error: unknown) => tell(String(error)));
