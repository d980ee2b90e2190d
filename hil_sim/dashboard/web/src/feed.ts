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

const FIRST_WAIT_S = 0.5;
const LONGEST_WAIT_S = 8;

export interface FeedListener {
  snapshot(snapshot: Snapshot, limits: Limits | null, remark: string): void;
  /** Why there is no feed, and after how long it is tried again. */
  lost(message: string, wait_s: number): void;
}

/** Listens until the page is closed; after a loss it connects again, after longer and longer waits. */
export function listen(listener: FeedListener): void {
  let wait_s = FIRST_WAIT_S;
  const connect = () => {
    listenOnce({
      snapshot: (...told) => {
        wait_s = FIRST_WAIT_S;
        listener.snapshot(...told);
      },
      ended: (message) => {
        listener.lost(message, wait_s);
        setTimeout(connect, 1000 * wait_s);
        wait_s = Math.min(2 * wait_s, LONGEST_WAIT_S);
      },
    });
  };
  connect();
}

/** Times of a server that may have begun anew, in s: they go on over a loss, with a gap in it. */
export class LiveClock {
  private offset_s = 0;
  private last: { time_s: number; at_ms: number } | null = null;
  private isLost = false;

  lose(): void {
    this.isLost = true;
  }

  /** The time to show, and that of a gap before it. */
  read(time_s: number): { time_s: number; gap_s: number | null } {
    const now_ms = performance.now();
    let gap_s: number | null = null;
    if (this.isLost && this.last !== null) {
      const passed_s = (now_ms - this.last.at_ms) / 1000;
      this.offset_s = this.last.time_s + passed_s - time_s;
      gap_s = this.last.time_s + passed_s / 2;
    }
    this.isLost = false;
    this.last = { time_s: time_s + this.offset_s, at_ms: now_ms };
    return { time_s: this.last.time_s, gap_s };
  }
}

interface Once {
  snapshot: FeedListener["snapshot"];
  ended(message: string): void; // once
}

function listenOnce(listener: Once): void {
  const address = new URL("feed", location.href);
  address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
  const socket = new WebSocket(address);
  let reason: string | null = null;
  let isOver = false;
  let timer: ReturnType<typeof setTimeout>;
  const end = (message: string) => {
    clearTimeout(timer);
    if (!isOver) {
      isOver = true;
      listener.ended(message);
    }
  };
  const expect = () => {
    clearTimeout(timer);
    timer = setTimeout(() => {
      socket.close();
      end(reason ?? "the server says nothing any more; see whether 'bms dashboard' still runs");
    }, LONGEST_SILENCE_MS);
  };
  expect();
  socket.addEventListener("message", (event: MessageEvent<string>) => {
    if (isOver) {
      return;
    }
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
  socket.addEventListener("close", () =>
    end(reason ?? "the server of the page is not there; start 'bms dashboard' on the same port"),
  );
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
