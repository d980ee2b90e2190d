// Runs charges at the wanted speed, away from the page, which stays responsive.

import { Engine } from "./engine";
import type { FromWorker, ToWorker } from "./messages";
import type { Session } from "./session";

const WORK_MS = 20; // at a time, so that what the page says is heard soon
const SHOW_MS = 50;
const MOST_BEHIND_S = 0.25; // of real time; what is missed beyond is not caught up

let engine: Engine | null = null;
let session: Session | null = null;
let run = 0;
let factor = 1;
let isRunning = false;
let timer: ReturnType<typeof setTimeout> | undefined;
let last_ms = 0;
let owed_s = 0; // of the charge
let shown_ms = -Infinity;

const post = (message: FromWorker) => self.postMessage(message);

function show(): void {
  if (session !== null) {
    shown_ms = performance.now();
    post({ type: "snapshot", run, snapshot: session.snapshot(), samples: session.takeSamples() });
  }
}

function work(): void {
  if (engine === null || session === null || !isRunning) {
    return;
  }
  const begin_ms = performance.now();
  const { period_s } = engine.preset;
  const passed_s = Math.min((begin_ms - last_ms) / 1000, MOST_BEHIND_S);
  owed_s = Number.isFinite(factor) ? owed_s + passed_s * factor : Infinity;
  last_ms = begin_ms;
  while (
    session.end === null &&
    owed_s >= period_s &&
    performance.now() - begin_ms < WORK_MS
  ) {
    session.step();
    owed_s -= period_s;
  }
  const isOver = session.end !== null;
  if (isOver || performance.now() - shown_ms >= SHOW_MS) {
    show();
  }
  if (!isOver) {
    const wait_s = Number.isFinite(factor) ? Math.max(0, period_s - owed_s) / factor : 0;
    timer = setTimeout(guarded, 1000 * Math.min(wait_s, SHOW_MS / 1000));
  }
}

function guarded(): void {
  try {
    work();
  } catch (error) {
    isRunning = false;
    post({ type: "error", message: String(error) });
  }
}

function resume(): void {
  clearTimeout(timer);
  last_ms = performance.now();
  owed_s = 0;
  guarded();
}

function take(message: ToWorker): void {
  switch (message.type) {
    case "load":
      engine = new Engine(message.module, message.database, message.preset);
      session = null;
      post({ type: "loaded", preset: message.preset });
      break;
    case "begin":
      session = engine!.begin(message.start, message.request);
      run++;
      session.setBeside(message.isBeside);
      if (message.row !== undefined) {
        session.inject(message.row, message.row.start.onset);
      }
      show();
      resume();
      break;
    case "request":
      if (session !== null) {
        session.request = { ...message.request };
        session.setCooling(message.request.cooling_W);
      }
      break;
    case "speed":
      factor = message.factor;
      resume();
      break;
    case "run":
      isRunning = message.isRunning;
      resume();
      break;
    case "beside":
      session?.setBeside(message.isOn);
      show();
      break;
    case "inject":
      session?.inject(message.row);
      break;
    case "log":
      post({ type: "log", lines: session?.log ?? [] });
      break;
  }
}

self.onmessage = (event: MessageEvent<ToWorker>) => {
  try {
    take(event.data);
  } catch (error) {
    post({ type: "error", message: String(error) });
  }
};
