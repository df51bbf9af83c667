/** The equations: the module of a mechanism, and what is read from its memory. */

import { type Mechanism, rowLength } from "./tables";

interface Face {
  memory: WebAssembly.Memory;
  _initialize(): void;
  studio_given(): number;
  studio_desk(): number;
  studio_rows(): number;
  studio_found(): number;
  studio_sentence(): number;
  studio_reset(): void;
  studio_reason(): number;
  studio_run(step: number, count: number): number;
  studio_orbit(warm: number): number;
  studio_turn(steps: number): number;
  studio_drag(joint: number, first: number, second: number): number;
}

export interface Orbit {
  found: boolean;
  /** Why there is none. */
  sentence: string;
  size: number;
  period: number;
  start: number[];
  /** Real and imaginary parts, the largest modulus first. */
  multipliers: [number, number][];
}

export interface Rows {
  values: Float64Array;
  count: number;
  /** Why there are no more, if that is so. */
  sentence: string;
}

export async function bytesOf(m: Mechanism): Promise<ArrayBuffer> {
  const packed = Uint8Array.from(atob(m.module), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

export class Core {
  private readonly face: Face;
  private readonly row: number;
  private readonly most: number;

  private constructor(mechanism: Mechanism, instance: WebAssembly.Instance) {
    this.face = instance.exports as unknown as Face;
    this.face._initialize();
    this.row = rowLength(mechanism);
    this.most = 2 * mechanism.freedoms.length;
  }

  static async make(mechanism: Mechanism, bytes: ArrayBuffer): Promise<Core> {
    const { instance } = await WebAssembly.instantiate(bytes, {});
    return new Core(mechanism, instance);
  }

  /** Put start values, and then these, by value reference. */
  give(given: [number, number][]): void {
    this.face.studio_reset();
    const memory = new Float64Array(this.face.memory.buffer, this.face.studio_given());
    for (const [reference, value] of given) memory[reference] = value;
  }

  given(reference: number): number {
    return new Float64Array(this.face.memory.buffer, this.face.studio_given())[reference];
  }

  /** What the last call says of why it went no further; empty where it did all. */
  sentence(): string {
    if (this.face.studio_reason() === 0) return "";
    const bytes = new Uint8Array(this.face.memory.buffer, this.face.studio_sentence(), 400);
    return new TextDecoder().decode(bytes.slice(0, bytes.indexOf(0)));
  }

  run(step: number, count: number): Rows {
    return this.rows(this.face.studio_run(step, count));
  }

  orbit(warm: boolean): Orbit {
    const found = this.face.studio_orbit(warm ? 1 : 0) === 1;
    const all = new Float64Array(this.face.memory.buffer, this.face.studio_found());
    const size = found ? all[0] : 0;
    const real = 4 + this.most + this.most * this.most;
    return {
      found,
      sentence: this.sentence(),
      size,
      period: all[3],
      start: Array.from(all.slice(4, 4 + size)),
      multipliers: Array.from({ length: size }, (_, i) => [all[real + i], all[real + this.most + i]]),
    };
  }

  turn(steps: number): Rows {
    return this.rows(this.face.studio_turn(steps));
  }

  /** Change one or two given values so that a joint comes to the target in a view; see studio.c. */
  drag(joint: number, moves: number[], view: number[], target: [number, number]): Rows {
    new Float64Array(this.face.memory.buffer, this.face.studio_desk(), 8).set([...view, ...target]);
    this.face.studio_drag(joint, moves[0], moves[1] ?? -1);
    return this.rows(1);
  }

  private rows(count: number): Rows {
    const start = this.face.studio_rows();
    const values = new Float64Array(this.face.memory.buffer, start, count * this.row).slice();
    return { values, count, sentence: this.sentence() };
  }
}
