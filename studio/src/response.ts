/** How far the slider swings over the speed, or over what else varies: stable and unstable motions, folds, doublings, what to avoid. */

import { type Arc, splitArcs, type Avoided, type Interval, findJumps, rangesToAvoid } from "./avoid";
import { make } from "./elements";
import type { Found } from "./explore";
import type { Point } from "./motions";
import { type Go, Search } from "./search";
import { type Context, driving, swinging } from "./varied";
import { type Given, givenValue, type Output } from "./tables";
import { called, digits, shown } from "./words";

const HEIGHT = 260;
/** How near a click must be to a motion to take it (px). */
const REACH = 20;

export class Response extends Search {
  protected readonly grid = undefined;
  /** Motions in the order of a branch, by the number of its part. */
  private parts: Point[][] = [];
  private sentences: string[] = [];
  /** Whose amplitude is shown, where several coordinates swing. */
  private readonly whose = make("select", { "aria-label": "Whose amplitude is shown" });
  avoided: Avoided[] = [];

  constructor(
    go: Go,
    private readonly tolerance: number,
  ) {
    super("Response: how far the links swing over the speed", ["What varies"], HEIGHT, go);
    this.whose.addEventListener("change", () => {
      if (this.done) this.tell();
      this.draw();
    });
    this.box.querySelector(".axes")!.append(this.whose);
    this.plane.canvas.setAttribute("role", "slider");
  }

  protected first(context: Context): (Given | undefined)[] {
    return [driving(context)];
  }

  protected clear(): void {
    this.parts = [];
    this.sentences = [];
    this.avoided = [];
    this.words.textContent = "Being computed …";
    const names = swinging(this.context!).map(called);
    this.whose.hidden = names.length < 2;
    if (names.join() === Array.from(this.whose.options, ({ value }) => value).join()) return;
    this.whose.replaceChildren(...names.map((name) => new Option(name)));
  }

  protected take(found: Found[], done: boolean): void {
    for (const one of found)
      if ("point" in one) (this.parts[one.part] ??= []).push(one.point);
      else if ("sentence" in one) this.sentences.push(this.ending(one.part, one.sentence));
    this.done = done;
    if (done) this.tell();
    this.draw();
  }

  /** Why a branch goes no further, and where. */
  private ending(part: number, sentence: string): string {
    const last = this.parts[part]?.at(-1);
    return `A branch ends${last ? ` at ${shown(last.value, this.axes[0].given!)}` : ""}: ${sentence}.`;
  }

  /** The branches: through the motion that is shown both ways, from the low end, from the high end. */
  get branches(): Point[][] {
    const [on, back, ...others] = [0, 1, 2, 3].map((part) => this.parts[part] ?? []);
    return [[...back.slice(1).reverse(), ...on], ...others].filter((branch) => branch.length > 1);
  }

  /** What varies, between which values, and the output whose amplitude is shown. */
  private get varied(): { given: Given; low: number; high: number; output: Output } {
    return { given: this.axes[0].given!, ...this.ranges[0], output: swinging(this.context!)[this.of] };
  }

  /** What is shown of all that swings. */
  private get of(): number {
    return Math.max(0, this.whose.selectedIndex);
  }

  private get arcs(): Arc[] {
    return this.branches.flatMap((branch) => splitArcs(branch, this.tolerance, this.of));
  }

  protected paint(): void {
    const { plane } = this;
    const { given, low, high, output } = this.varied;
    const all = this.branches.flat();
    const scale = (point: Point): Interval => [
      point.value * given.factor,
      point.amplitudes[this.of] * output.factor,
    ];
    const inside = all.filter((point) => point.value >= low && point.value <= high);
    const largest = Math.max(0, ...inside.map((point) => scale(point)[1]));
    // where there is nothing but rounding the axis goes to 1
    const top = largest > 1e-9 ? 1.08 * largest : 1;
    const x: Interval = [low * given.factor, high * given.factor];
    plane.frame(x, [0, top], [`${called(given)} [${given.unit}]`, `amplitude [${output.unit}]`]);
    const c = plane.context;
    c.strokeStyle = plane.colour("line");
    for (const { low: from, high: to } of this.avoided)
      plane.hatch([from * given.factor, to * given.factor], [0, top], 9);
    for (const { stable, points } of this.arcs) {
      c.strokeStyle = plane.colour(stable ? "accent" : "bad");
      c.lineWidth = stable ? 2.4 : 1.4;
      plane.line(points.map(scale), stable ? [] : [5, 4]);
    }
    c.fillStyle = plane.colour("text");
    for (const point of all) {
      if (!point.kind) continue;
      const [px, py] = [plane.px(scale(point)[0]), plane.py(scale(point)[1])];
      c.save();
      c.translate(px, py);
      if (point.kind === "doubling") c.rotate(Math.PI / 4);
      c.fillRect(-4, -4, 8, 8);
      c.restore();
    }
    const now = givenValue(given, this.context!.values) * given.factor;
    c.lineWidth = 1.5;
    c.strokeStyle = plane.colour("text");
    plane.mark(now, "x");
    const { canvas } = plane;
    canvas.setAttribute("aria-label", `${called(given)}, with the amplitude over it`);
    canvas.setAttribute("aria-valuemin", String(x[0]));
    canvas.setAttribute("aria-valuemax", String(x[1]));
    canvas.setAttribute("aria-valuenow", String(now));
    canvas.setAttribute("aria-valuetext", `${digits(now)} ${given.unit}`);
  }

  /** In words: where it swings, what to avoid, what happens at folds and doublings. */
  private tell(): void {
    const { given, low, high, output } = this.varied;
    const at = (value: number): string => shown(value, given);
    const { arcs } = this;
    // where nothing was found there may be reasons that the sentences give
    this.avoided = arcs.length > 0 ? rangesToAvoid(arcs, low, high, swinging(this.context!).map(called)) : [];
    const speed = given.unit === "rpm" ? "Speeds" : `Values of ${called(given)}`;
    const { natural } = this.context!;
    const avoided = this.avoided.map((one) => `${at(one.low)} to ${at(one.high)} (${one.why})`).join("; ");
    const lines = [
      arcs.length > 0
        ? `${speed} to avoid: ${avoided || "none in this range"}.`
        : "No periodic motion was found.",
      "Motions that no branch leads to were not sought; the command linkwork resonance seeks them.",
    ];
    for (const { value, rising, before, after } of findJumps(arcs)) {
      const then = after.map((amplitude) => shown(amplitude, output)).join(" or ");
      lines.push(
        `Fold at ${at(value)}: where ${called(given)} ${rising ? "rises" : "falls"} past it, the motion of ` +
          `${shown(before, output)} ${then ? `jumps to ${then}` : "ends, and no other stable one was followed"}.`,
      );
    }
    const doublings = this.branches.flat().filter((point) => point.kind === "doubling");
    if (doublings.length > 0)
      lines.push(`The period doubles at ${doublings.map((point) => at(point.value)).join(", ")}.`);
    if (Number.isFinite(natural) && given.unit === "rpm")
      lines.push(`Natural frequency ${shown(natural, given)} (mean effective mass).`);
    lines.push(
      ...new Set(this.sentences),
      "Solid: stable; dashed: unstable; square: fold; diamond: the period doubles; hatched: to avoid.",
    );
    this.words.replaceChildren(...lines.map((textContent) => make("p", { textContent })));
  }

  protected point(event: MouseEvent): void {
    const { given, output } = this.varied;
    const [x, y] = this.plane.at(event);
    const away = (point: Point): number =>
      Math.hypot(
        this.plane.px(point.value * given.factor) - this.plane.px(x),
        this.plane.py(point.amplitudes[this.of] * output.factor) - this.plane.py(y),
      );
    let best: Point | undefined;
    for (const point of this.branches.flat()) if (!best || away(point) < away(best)) best = point;
    if (best && away(best) < REACH) this.go({ [given.name]: best.value }, best.start);
    else this.set(x / given.factor);
  }

  /** Go to a value, within the range. */
  private set(value: number): void {
    const { given, low, high } = this.varied;
    this.go({ [given.name]: Math.max(low, Math.min(high, value)) });
  }

  protected press({ key, shiftKey }: KeyboardEvent): boolean {
    const { given, low, high } = this.varied;
    const sense = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 }[key];
    if (sense === undefined) return false;
    const now = givenValue(given, this.context!.values);
    this.set(now + (sense * (shiftKey ? 10 : 1) * (high - low)) / 200);
    return true;
  }
}
