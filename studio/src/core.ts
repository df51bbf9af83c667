/** The equations: the module of a mechanism, and what is read from its memory. */

import type { Orbit, Point, Rows } from "./motions";
import { type Mechanism, rowLength } from "./tables";
import { plainly } from "./words";

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
  studio_motor(): number;
  studio_branch(reference: number, size: number, sense: number): number;
  studio_follow(): number;
  studio_amplitudes(): void;
  studio_natural(reference: number): number;
  studio_drag(joint: number, first: number, second: number): number;
}

export async function moduleBytes(m: Mechanism): Promise<ArrayBuffer> {
  const packed = Uint8Array.from(atob(m.module), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

export class Core {
  private readonly face: Face;
  private readonly row: number;
  private readonly most: number;

  private constructor(
    private readonly mechanism: Mechanism,
    instance: WebAssembly.Instance,
  ) {
    this.face = instance.exports as unknown as Face;
    this.face._initialize();
    this.row = rowLength(mechanism);
    this.most = 2 * mechanism.freedoms.length;
  }

  static async make(mechanism: Mechanism, bytes: ArrayBuffer): Promise<Core> {
    const { instance } = await WebAssembly.instantiate(bytes, {});
    return new Core(mechanism, instance);
  }

  /** Put start values, and then these, by value reference: those below 0 are of the motor. */
  give(given: [number, number][]): void {
    this.face.studio_reset();
    const memory = new Float64Array(this.face.memory.buffer, this.face.studio_given());
    const motor = new Float64Array(this.face.memory.buffer, this.face.studio_motor());
    for (const [reference, value] of given)
      if (reference < 0) motor[-1 - reference] = value;
      else memory[reference] = value;
  }

  given(reference: number): number {
    return new Float64Array(this.face.memory.buffer, this.face.studio_given())[reference];
  }

  /** What the last call says of why it went no further; empty where it did all. */
  sentence(): string {
    if (this.face.studio_reason() === 0) return "";
    const bytes = new Uint8Array(this.face.memory.buffer, this.face.studio_sentence(), 400);
    return plainly(new TextDecoder().decode(bytes.slice(0, bytes.indexOf(0))), this.mechanism);
  }

  run(step: number, count: number): Rows {
    return this.rows(this.face.studio_run(step, count));
  }

  /** The periodic motion, sought from this start, or else from that of the one found before. */
  orbit(start?: number[]): Orbit {
    if (start) this.found().set([start.length, 0, 0, 0, ...start]);
    return this.motion(this.face.studio_orbit(1) === 1);
  }

  private found(): Float64Array {
    return new Float64Array(
      this.face.memory.buffer,
      this.face.studio_found(),
      7 + 5 * this.most + this.most ** 2,
    );
  }

  private motion(found: boolean): Orbit {
    const all = this.found();
    const size = found ? all[0] : 0;
    const real = 4 + this.most + this.most * this.most;
    const place = real + 2 * this.most + 3;
    return {
      found,
      sentence: this.sentence(),
      size,
      period: all[3],
      start: Array.from(all.slice(4, 4 + size)),
      places: Array.from(all.slice(place, place + all[place - 1])),
      multipliers: Array.from({ length: size }, (_, i) => [all[real + i], all[real + this.most + i]]),
    };
  }

  /** Begin a branch at the motion that was found: over what, in what range, and the way that it first goes. */
  branch(reference: number, size: number, sense: number): boolean {
    return this.face.studio_branch(reference, size, sense) === 1;
  }

  /** The next motion on the branch; nothing where there is none. */
  follow(): Omit<Point, "amplitudes"> | undefined {
    if (this.face.studio_follow() !== 1) return undefined;
    const { start, multipliers } = this.motion(true);
    const [value, kind] = this.found().slice(4 + 3 * this.most + this.most ** 2);
    return { value, start, multipliers, kind: (["", "fold", "doubling"] as const)[kind] };
  }

  /** Half of how far each coordinate swings in the motion that was found. */
  amplitudes(): number[] {
    this.face.studio_amplitudes();
    const all = this.found();
    const swing = all.length - this.most;
    return Array.from(all.slice(swing, swing + all[swing - this.most - 1]));
  }

  /** The natural frequency (rad/s) under what is given; see studio_natural. */
  natural(reference: number): number {
    return this.face.studio_natural(reference);
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
