/** The motion that is shown, and the instant of it that is drawn. */

import { type Mechanism, outputPlace, rowLength } from "./tables";
import type { Answer } from "./worker";

export class Playback {
  /** What the worker answered last, and which row of it is drawn. */
  answer: Answer | undefined;
  row = 0;
  time = 0;
  moving = true;
  private mechanism!: Mechanism;

  /** Begin with another mechanism. */
  show(mechanism: Mechanism): void {
    this.mechanism = mechanism;
    this.answer = undefined;
    this.row = 0;
    this.time = 0;
  }

  get count(): number {
    return this.answer?.rows.count ?? 0;
  }

  /** How long the motion is (s). */
  get length(): number {
    return this.count > 0 ? this.timeOf(this.count - 1) : 0;
  }

  get share(): number {
    return this.length > 0 ? this.time / this.length : 0;
  }

  timeOf(row: number): number {
    return this.answer!.rows.values[row * rowLength(this.mechanism)];
  }

  valuesOf(row: number): Float64Array {
    const length = rowLength(this.mechanism);
    return this.answer!.rows.values.subarray(row * length, (row + 1) * length);
  }

  /** The row nearest to the time. */
  nearest(): number {
    let [low, high] = [0, this.count - 1];
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (this.timeOf(middle) <= this.time) low = middle;
      else high = middle;
    }
    if (high < 0) return 0;
    return this.timeOf(high) - this.time < this.time - this.timeOf(low) ? high : low;
  }

  /** Let the time go on; whether it did. */
  advance(seconds: number): boolean {
    if (!this.moving || this.length === 0) return false;
    this.time = (this.time + seconds) % this.length;
    return true;
  }

  /** When the motion comes to the crank angle of these values: the rows of a turn are at equal steps of it. */
  resumed(values: Float64Array): number {
    const m = this.mechanism;
    if (m.crank < 0 || this.answer?.source !== "steady") return this.time;
    const freedom = m.freedoms[m.crank];
    const turns = values[outputPlace(m, freedom.coordinate)] / freedom.period;
    return this.timeOf(Math.round((turns - Math.floor(turns)) * (this.count - 1)));
  }
}
