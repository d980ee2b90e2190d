// A log as `candump -L` writes it, and as hil_sim/logs/writer.py does.

import type { Frame } from "./codec";

export const CHANNEL = "vcan0";

const HEX = Array.from({ length: 256 }, (_, byte) => byte.toString(16).toUpperCase().padStart(2, "0"));

/** Lines of frames of one time. */
export function candump(time_s: number, frames: readonly Frame[], isReceived: boolean): string {
  const begin = `(${time_s.toFixed(6)}) ${CHANNEL} `;
  const end = isReceived ? " R\n" : " T\n";
  let lines = "";
  for (const frame of frames) {
    let data = "";
    for (const byte of frame.data) {
      data += HEX[byte];
    }
    lines += `${begin}${frame.id.toString(16).toUpperCase().padStart(3, "0")}#${data}${end}`;
  }
  return lines;
}
