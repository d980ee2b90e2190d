// Random numbers as numpy draws them, for faults that are random: SeedSequence, PCG64, and integers
// by Lemire's method. Those of the sensors are drawn in C, see hil_sim/dashboard/native/normals.c.
// Sources: M. O'Neill, PCG (2014); D. Lemire, Fast random integer generation in an interval (2019).

const FAULTS_STREAM = 2; // child of the seed that hil_sim/run/parts.py gives the faults
const POOL = 4;
const MASK_64 = (1n << 64n) - 1n;
const MASK_128 = (1n << 128n) - 1n;
const FACTOR = 0x2360ed051fc65da44385df649fccf645n;

class Hash {
  constructor(
    private constant: number,
    private readonly factor: number,
  ) {}

  of(value: number): number {
    let mixed = value ^ this.constant;
    this.constant = Math.imul(this.constant, this.factor);
    mixed = Math.imul(mixed, this.constant);
    return (mixed ^ (mixed >>> 16)) >>> 0;
  }
}

function mixed(into: number, value: number): number {
  const mix = (Math.imul(0xca01f9dd, into) - Math.imul(0x4973f715, value)) | 0;
  return (mix ^ (mix >>> 16)) >>> 0;
}

/** Four words of 64 bits. */
function seedWords(seed: number, spawnKey: readonly number[]): bigint[] {
  const entropy = [seed, 0, 0, 0, ...spawnKey];
  const hash = new Hash(0x43b0d7e5, 0x931e8875);
  const pool = entropy.slice(0, POOL).map((word) => hash.of(word));
  const stir = (to: number, word: number) => {
    pool[to] = mixed(pool[to]!, hash.of(word));
  };
  for (let from = 0; from < POOL; from++) {
    for (let to = 0; to < POOL; to++) {
      if (from !== to) {
        stir(to, pool[from]!);
      }
    }
  }
  for (const word of entropy.slice(POOL)) {
    for (let to = 0; to < POOL; to++) {
      stir(to, word);
    }
  }
  const out = new Hash(0x8b51f9dd, 0x58f38ded);
  const words = Array.from({ length: 2 * POOL }, (_, i) => BigInt(out.of(pool[i % POOL]!)));
  return Array.from({ length: POOL }, (_, i) => words[2 * i]! | (words[2 * i + 1]! << 32n));
}

/** The generator of one fault of a run. */
export class FaultRandom {
  private state: bigint;
  private readonly increment: bigint;
  private half: number | null = null;

  constructor(seed: number, fault: number) {
    const words = seedWords(seed, [FAULTS_STREAM, fault]);
    this.increment = ((((words[2]! << 64n) | words[3]!) << 1n) | 1n) & MASK_128;
    this.state = 0n;
    this.step();
    this.state = (this.state + ((words[0]! << 64n) | words[1]!)) & MASK_128;
    this.step();
  }

  /** An integer from 0 to below a count, as Generator.integers. */
  below(count: number): number {
    const threshold = (2 ** 32 - count) % count;
    for (;;) {
      const product = BigInt(this.word()) * BigInt(count);
      if (Number(product & 0xffffffffn) >= threshold) {
        return Number(product >> 32n);
      }
    }
  }

  /** As Generator.bytes. */
  bytes(count: number): Uint8Array {
    const words = Uint32Array.from({ length: Math.ceil(count / 4) }, () => this.word());
    return new Uint8Array(words.buffer, 0, count);
  }

  private word(): number {
    if (this.half !== null) {
      const word = this.half;
      this.half = null;
      return word;
    }
    this.step();
    const high = this.state >> 64n;
    const folded = (high ^ this.state) & MASK_64;
    const turn = high >> 58n;
    const bits = ((folded >> turn) | (folded << ((64n - turn) & 63n))) & MASK_64;
    this.half = Number(bits >> 32n);
    return Number(bits & 0xffffffffn);
  }

  private step(): void {
    this.state = (this.state * FACTOR + this.increment) & MASK_128;
  }
}
