// Frames to values and back, as hil_sim/bus/database.py.

import type { Database, Message } from "./data";

export interface Frame {
  id: number;
  data: Uint8Array;
}

export type Values = Record<string, number | null>;

const COUNTERS = 16;

const CRC_TABLE = Uint8Array.from({ length: 256 }, (_, byte) => {
  let crc = byte;
  for (let bit = 0; bit < 8; bit++) {
    crc = (crc & 0x80) !== 0 ? ((crc << 1) ^ 0x2f) & 0xff : (crc << 1) & 0xff;
  }
  return crc;
});

/** CRC-8H2F over all but the first byte, then the data id. Source: AUTOSAR E2E, profile 2. */
export function crcOf(data: Uint8Array, dataId: number): number {
  let crc = 0xff;
  for (let i = 1; i < data.length; i++) {
    crc = CRC_TABLE[crc ^ data[i]!]!;
  }
  return CRC_TABLE[crc ^ dataId]! ^ 0xff;
}

export function counterOf(data: Uint8Array): number {
  return data[1]! % COUNTERS;
}

/** The same content with another counter, and the CRC that belongs to it. */
export function withCounter(message: Message, data: Uint8Array, counter: number): Uint8Array {
  const changed = data.slice();
  changed[1] = (data[1]! & 0xf0) | (counter % COUNTERS);
  changed[0] = crcOf(changed, message.data_ids[counter % COUNTERS]!);
  return changed;
}

export function isIntact(message: Message, data: Uint8Array): boolean {
  if (data.length !== message.length) {
    return false;
  }
  const dataId = message.data_ids[data.length > 1 ? counterOf(data) : 0];
  return dataId === undefined || data[0] === crcOf(data, dataId);
}

function bitsOf(data: Uint8Array): bigint {
  let bits = 0n;
  for (let i = data.length - 1; i >= 0; i--) {
    bits = (bits << 8n) | BigInt(data[i]!);
  }
  return bits;
}

/** Values of an intact payload; null for what is not available. */
export function decode(message: Message, data: Uint8Array): Values {
  const bits = bitsOf(data);
  const values: Values = {};
  for (const signal of message.signals) {
    const raw = Number((bits >> BigInt(signal.start)) & ((1n << BigInt(signal.length)) - 1n));
    const carries = raw >= signal.lowest && raw <= signal.highest;
    values[signal.name] = carries ? (raw + signal.offset_steps) * signal.scale : null;
  }
  return values;
}

/** The payload with one signal changed, and its CRC. */
export function withSignal(
  message: Message,
  data: Uint8Array,
  name: string,
  value: number,
): Uint8Array {
  const signal = message.signals.find((one) => one.name === name)!;
  const steps = value / signal.scale - signal.offset_steps;
  const raw = Math.round(Math.min(Math.max(steps, signal.lowest), signal.highest));
  const mask = ((1n << BigInt(signal.length)) - 1n) << BigInt(signal.start);
  let bits = (bitsOf(data) & ~mask) | (BigInt(raw) << BigInt(signal.start));
  const changed = new Uint8Array(data.length);
  for (let i = 0; i < changed.length; i++) {
    changed[i] = Number(bits & 0xffn);
    bits >>= 8n;
  }
  return withCounter(message, changed, counterOf(data));
}

/** Messages of the database by name and by identifier. */
export class Codecs {
  readonly byName: ReadonlyMap<string, Message>;
  readonly byId: ReadonlyMap<number, Message>;

  constructor(readonly database: Database) {
    this.byName = new Map(database.messages.map((message) => [message.name, message]));
    this.byId = new Map(database.messages.map((message) => [message.id, message]));
  }

  named(name: string): Message {
    const message = this.byName.get(name);
    if (message === undefined) {
      throw new Error(`the CAN database has no message ${name}; reload the page`);
    }
    return message;
  }

  /** Name of a signal's value in small letters; null without a value. */
  choice(signal: string, value: number | null | undefined): string | null {
    if (value === null || value === undefined) {
      return null;
    }
    const name = this.database.choices[signal]?.[String(value)];
    return (name ?? String(value)).toLowerCase().replaceAll("_", "-");
  }
}
