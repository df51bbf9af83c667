/** Verdicts over a plane of two parameters, coarse to fine. */

import { type Cell, type Found, middle } from "./explore";
import { type Go, Search } from "./search";
import { type Context, driving } from "./varied";
import { type Given, givenValue } from "./tables";
import { arrowOf } from "./view";
import { called, multiplierInWords, shown, verdictInWords } from "./words";

const HEIGHT = 300;

export class Stability extends Search {
  protected readonly grid: [number, number] = [48, 32];
  /** By the place in the grid, those of coarser grids first. */
  readonly cells = new Map<number, Cell>();
  /** The square that keys have gone to. */
  private place: [number, number] | undefined;

  constructor(
    go: Go,
    private readonly tolerance: number,
  ) {
    super(
      "Stability chart: where the periodic motion is stable",
      ["Along the width", "Along the height"],
      HEIGHT,
      go,
    );
    this.plane.canvas.setAttribute("role", "application");
  }

  protected first(context: Context): (Given | undefined)[] {
    const { given, damping } = context.mechanism;
    return [driving(context), given.find((one) => one.name === damping)];
  }

  protected clear(): void {
    this.cells.clear();
    this.place = undefined;
    this.words.textContent =
      "Filled: stable; hatched: unstable; a cross: no periodic motion found. A click goes there.";
  }

  protected take(found: Found[], done: boolean): void {
    for (const one of found)
      if ("cell" in one) this.cells.set(one.cell.row * this.grid[0] + one.cell.column, one.cell);
      else if ("sentence" in one) this.words.textContent = one.sentence;
    this.done = done;
    this.draw();
  }

  verdict({ found, multipliers }: Cell): string {
    return verdictInWords({ found, multipliers, size: multipliers.length }, this.tolerance);
  }

  private scaled(axis: number, share: number): number {
    const { low, high } = this.ranges[axis];
    return (low + share * (high - low)) * this.axes[axis].given!.factor;
  }

  protected paint(): void {
    const { plane } = this;
    const [x, y] = this.axes.map(({ given }) => given!);
    const name = (given: Given): string => `${called(given)} [${given.unit}]`;
    const ends = [0, 1].map((axis): [number, number] => [this.scaled(axis, 0), this.scaled(axis, 1)]);
    plane.frame(ends[0], ends[1], [name(x), name(y)]);
    const c = plane.context;
    for (const cell of this.cells.values()) {
      const [columns, rows] = this.grid;
      const size = cell.size;
      const across: [number, number] = [cell.column / columns, (cell.column + size) / columns];
      const up: [number, number] = [cell.row / rows, (cell.row + size) / rows];
      const [left, right] = across.map((share) => this.scaled(0, Math.min(1, share)));
      const [low, high] = up.map((share) => this.scaled(1, Math.min(1, share)));
      const verdict = this.verdict(cell);
      const stable = verdict === "stable" || verdict.startsWith("prescribed");
      // on whole pixels: no seams between squares
      const [px, py] = [Math.round(plane.px(left)), Math.round(plane.py(high))];
      const [width, height] = [Math.round(plane.px(right)) - px, Math.round(plane.py(low)) - py];
      // the coarser square lies under it
      c.fillStyle = plane.colour("card");
      c.fillRect(px, py, width, height);
      c.fillStyle = plane.colour("accent");
      c.globalAlpha = stable ? 0.45 : 0;
      c.fillRect(px, py, width, height);
      c.globalAlpha = 1;
      c.lineWidth = 1.3;
      c.strokeStyle = plane.colour(cell.found ? "bad" : "soft");
      if (stable) continue;
      if (cell.found) plane.hatch([left, right], [low, high], verdict === "marginal" ? 12 : 6);
      else {
        const [middleX, middleY, half] = [px + width / 2, py + height / 2, Math.min(width, height) / 4];
        c.beginPath();
        for (const way of [-1, 1]) {
          c.moveTo(middleX - half, middleY - way * half);
          c.lineTo(middleX + half, middleY + way * half);
        }
        c.stroke();
      }
    }
    const now = [x, y].map((given) => givenValue(given, this.context!.values) * given.factor);
    c.lineWidth = 1.5;
    c.strokeStyle = plane.colour("text");
    plane.mark(now[0], "x");
    plane.mark(now[1], "y");
    if (this.place) {
      const [column, row] = this.place;
      const corners = [0, 1, 1, 0, 0].map((dx, n): [number, number] => [
        this.scaled(0, (column + dx) / this.grid[0]),
        this.scaled(1, (row + (n === 2 || n === 3 ? 1 : 0)) / this.grid[1]),
      ]);
      c.lineWidth = 2.5;
      plane.line(corners);
    }
    plane.canvas.setAttribute(
      "aria-label",
      `Stability over ${called(x)} and ${called(y)}: arrow keys go from square to square, Enter takes one`,
    );
  }

  /** The square of the finest grid there is at a place. */
  private at([column, row]: [number, number]): Cell | undefined {
    for (const size of [1, 2, 4, 8]) {
      const found = this.cells.get((row - (row % size)) * this.grid[0] + column - (column % size));
      if (found && found.size >= size) return found;
    }
    return undefined;
  }

  private goTo(cell: Cell): void {
    const values = [cell.column, cell.row].map((place, axis) =>
      middle(this.ranges[axis], this.grid[axis], place),
    );
    const names = this.axes.map(({ given }) => given!.name);
    this.go({ [names[0]]: values[0], [names[1]]: values[1] }, cell.start);
  }

  protected point(event: MouseEvent): void {
    const found = this.plane.at(event).map((value, axis) => {
      const [low, high] = [this.scaled(axis, 0), this.scaled(axis, 1)];
      return Math.floor((this.grid[axis] * (value - low)) / (high - low));
    });
    const cell = this.at([found[0], found[1]]);
    if (cell) this.goTo(cell);
  }

  protected press(event: KeyboardEvent): boolean {
    const way = arrowOf(event);
    const before = this.place ?? [this.grid[0] >> 1, this.grid[1] >> 1];
    if (way) {
      const [column, row] = [0, 1].map((axis) =>
        Math.max(0, Math.min(this.grid[axis] - 1, before[axis] + (this.place ? way[axis] : 0))),
      );
      this.place = [column, row];
      const cell = this.at(this.place);
      const where = this.axes.map(
        ({ given }, axis) =>
          `${called(given!)} ${shown(middle(this.ranges[axis], this.grid[axis], this.place![axis]), given!)}`,
      );
      const multiplier = cell?.multipliers[0] ? `, multiplier ${multiplierInWords(cell.multipliers[0])}` : "";
      this.words.textContent = `${where.join(", ")}: ${cell ? this.verdict(cell) : "not yet known"}${multiplier}`;
      this.draw();
      return true;
    }
    const cell = event.key === "Enter" && this.place ? this.at(this.place) : undefined;
    if (cell) this.goTo(cell);
    return cell !== undefined;
  }
}
