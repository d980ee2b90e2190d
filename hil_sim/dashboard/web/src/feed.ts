// A running bus as the server sees it, over a websocket. Nothing is ever sent.

import type { Limits } from "./data";
import type { Snapshot } from "./session";

export interface FeedMessage {
  error?: string;
  snapshot?: Omit<Snapshot, "truth" | "beside" | "verdicts" | "violations" | "end" | "charge_s">;
  limits?: Limits | null;
  remark?: string;
  is_silent?: boolean;
  silence_s?: number | null;
}

const LONGEST_SILENCE_MS = 5000; // of the server, which says something several times a second

export interface FeedListener {
  snapshot(snapshot: Snapshot, limits: Limits | null, remark: string): void;
  ended(message: string): void;
}

export function listen(listener: FeedListener): void {
  const address = new URL("feed", location.href);
  address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
  const socket = new WebSocket(address);
  let reason: string | null = null;
  let timer: ReturnType<typeof setTimeout>;
  const expect = () => {
    clearTimeout(timer);
    timer = setTimeout(() => {
      reason ??= "the server says nothing any more; see whether 'bms dashboard' still runs";
      socket.close();
      listener.ended(reason);
    }, LONGEST_SILENCE_MS);
  };
  expect();
  socket.addEventListener("message", (event: MessageEvent<string>) => {
    expect();
    const message = parsed(event.data);
    if (message.error !== undefined) {
      reason = message.error;
    } else if (message.snapshot !== undefined) {
      const whole = { ...message.snapshot, truth: null, beside: null, end: null, charge_s: null };
      const remark = silence(message) ?? message.remark ?? "";
      listener.snapshot({ ...whole, verdicts: [], violations: [] }, message.limits ?? null, remark);
    }
  });
  socket.addEventListener("close", () => {
    clearTimeout(timer);
    listener.ended(reason ?? "the server has ended the feed; start 'bms dashboard' and reload");
  });
}

function parsed(text: string): FeedMessage {
  try {
    return JSON.parse(text) as FeedMessage;
  } catch {
    return { error: "the server has said what is no JSON; reload the page" };
  }
}

function silence(message: FeedMessage): string | null {
  if (message.silence_s === null) {
    return "waiting for frames";
  }
  return message.is_silent === true
    ? `the bus has been silent for ${(message.silence_s ?? 0).toFixed(0)} s`
    : null;
}
