/** What is common to charts that take seconds: what varies and between which values, a search that goes on beside the page. */

import { Explorer } from "./background";
import { make } from "./elements";
import type { Exploration, Found } from "./explore";
import { Plane } from "./plane";
import { type Given, type Mechanism, type Range, type Values, allGiven, givenValue } from "./tables";
import { type Context, variables } from "./varied";
import { called, digits } from "./words";

/** How long all must stay as it is before a search begins anew (ms). */
const REST = 250;
/** Of speeds about the natural frequency, and of others about the value there is. */
const ABOUT: [number, number] = [0.15, 2.3];
const OTHERS: [number, number] = [0.1, 2];

/** Where the page is to go: values by name, and where the motion there is sought first. */
export type Go = (values: Values, start?: number[]) => void;

interface Axis {
  select: HTMLSelectElement;
  ends: HTMLInputElement[];
  given: Given | undefined;
}

export abstract class Search {
  readonly box: HTMLElement;
  protected readonly plane: Plane;
  protected readonly words = make("div", { className: "told", "aria-live": "polite" });
  /** What is wrong with a range. */
  private readonly fault = make("p", { className: "fault", role: "alert" });
  protected readonly axes: Axis[];
  protected context: Context | undefined;
  private readonly explorer = new Explorer((found, done) => this.take(found, done));
  /** Ranges that were typed, by name. */
  private readonly typed = new Map<string, [number, number]>();
  private key = "";
  private timer = 0;
  private active = false;
  /** Whether all was found. */
  done = false;

  constructor(
    title: string,
    names: string[],
    height: number,
    protected readonly go: Go,
  ) {
    const row = make("div", { className: "axes" });
    this.axes = names.map((name) => this.axis(row, name));
    this.box = make("figure", { "aria-label": title }, row, this.fault);
    this.plane = new Plane(this.box, height);
    this.box.append(this.words);
    this.plane.onSize = () => this.draw();
    const { canvas } = this.plane;
    canvas.tabIndex = 0;
    canvas.setAttribute("aria-label", title);
    canvas.addEventListener("click", (event) => this.point(event));
    canvas.addEventListener("keydown", (event) => {
      if (!this.press(event)) return;
      event.preventDefault();
      event.stopPropagation();
    });
  }

  /** What is varied first: names of the axes. */
  protected abstract first(context: Context): (Given | undefined)[];
  /** The number of squares along each axis, of a chart. */
  protected abstract readonly grid: [number, number] | undefined;
  protected abstract clear(): void;
  protected abstract take(found: Found[], done: boolean): void;
  protected abstract paint(): void;
  protected abstract point(event: MouseEvent): void;
  /** Whether a key did something. */
  protected abstract press(event: KeyboardEvent): boolean;

  open(mechanism: Mechanism, bytes: ArrayBuffer): void {
    this.explorer.use(mechanism, bytes);
    for (const axis of this.axes) axis.given = undefined;
    this.typed.clear();
    this.context = undefined;
    this.ranges = [];
    this.forget();
  }

  show(active: boolean): void {
    this.active = active;
    // what is not looked at goes on
    if (active) this.renew();
  }

  /** The motion that is shown is another. */
  see(context: Context): void {
    this.context = context;
    if (this.active) this.renew();
  }

  private forget(): void {
    this.key = "";
    clearTimeout(this.timer);
    this.explorer.stop();
  }

  /** Search anew where another thing than what is varied has changed. */
  private renew(): void {
    const { context } = this;
    if (!context) return;
    this.choices(context);
    const names = this.axes.map(({ given }) => given?.name);
    let none = "";
    if (context.orbit.places.length === 0) none = "All motion is prescribed: nothing is free to swing.";
    else if (new Set(names).size < names.length)
      none = `Both axes are the ${called(this.axes[0].given!)}: choose another variable for one of them.`;
    // nothing is drawn then
    this.plane.canvas.hidden = none !== "";
    for (const { ends } of this.axes) for (const end of ends) end.disabled = none !== "";
    if (none) {
      this.forget();
      this.ranges = [];
      this.clear();
      this.words.textContent = none;
      return;
    }
    const kept = Object.entries(context.values).filter(([name]) => !names.includes(name));
    const ranges = this.axes.map(({ given }) => given && this.typed.get(given.name));
    const key = JSON.stringify([kept, names, ranges, context.orbit.found]);
    if (key !== this.key) {
      this.forget();
      this.key = key;
      this.done = false;
      this.box.classList.add("old");
      for (const { ends, given } of this.axes) {
        const { low, high } = this.range(given!);
        ends.forEach((end, i) => (end.value = digits((i ? high : low) * given!.factor, 6)));
      }
      this.timer = window.setTimeout(() => this.begin(), REST);
    }
    this.draw();
  }

  private begin(): void {
    const { mechanism, values, orbit } = this.context!;
    this.box.classList.remove("old");
    this.clear();
    this.ranges = this.axes.map(({ given }) => this.range(given!));
    const [{ given }] = this.axes;
    const task: Exploration = {
      given: allGiven(mechanism, values),
      axes: this.ranges,
      start: orbit.start,
      at: givenValue(given!, values),
    };
    if (this.grid) task.grid = this.grid;
    this.explorer.ask(task);
    this.draw();
  }

  protected ranges: Range[] = [];

  private range(given: Given): Range {
    const { natural, values } = this.context!;
    const { reference } = given;
    const value = givenValue(given, values);
    const typed = this.typed.get(given.name);
    if (typed) return { reference, low: typed[0], high: typed[1] };
    const sign = value < 0 ? -1 : 1;
    const speed = given.unit === "rpm" && Number.isFinite(natural);
    const ends = speed
      ? [Math.min(ABOUT[0] * natural, 0.9 * sign * value), Math.max(ABOUT[1] * natural, 1.1 * sign * value)]
      : OTHERS.map((share) => share * (sign * value || given.nominal || 1));
    const [low, high] = ends.map((end) => sign * end).sort((a, b) => a - b);
    return { reference, low, high };
  }

  draw(): void {
    if (this.context && this.active && this.ranges.length > 0) this.paint();
  }

  private axis(row: HTMLElement, name: string): Axis {
    const select = make("select", { "aria-label": name });
    const box = make("span", {}, select);
    const axis: Axis = { select, ends: [], given: undefined };
    select.addEventListener("change", () => {
      axis.given = this.context!.mechanism.given.find((given) => given.name === select.value);
      this.fault.textContent = "";
      this.renew();
    });
    for (const word of ["from", "to"]) {
      const end = make("input", { type: "number", step: "any", "aria-label": `${name}: ${word}` });
      end.addEventListener("change", () => {
        const given = axis.given!;
        const [low, high] = axis.ends.map((one) => one.valueAsNumber / given.factor);
        const right = low < high;
        if (right) this.typed.set(given.name, [low, high]);
        this.fault.textContent = right
          ? ""
          : `The ${called(given)} must go from a smaller to a larger number: the chart keeps the range that it has.`;
        this.renew();
      });
      box.append(` ${word} `, end);
      axis.ends.push(end);
    }
    row.append(box);
    return axis;
  }

  /** The lists of what can vary, which follow what acts. */
  private choices(context: Context): void {
    const all = variables(context);
    const first = this.first(context);
    this.axes.forEach((axis, n) => {
      if (!axis.given || !all.includes(axis.given)) axis.given = first[n] ?? all[n];
      const names = all.map((given) => given.name);
      if (names.join() !== Array.from(axis.select.options, (option) => option.value).join())
        axis.select.replaceChildren(
          ...all.map(
            (given) => new Option(`${called(given)}${given.unit ? ` [${given.unit}]` : ""}`, given.name),
          ),
        );
      axis.select.value = axis.given?.name ?? "";
    });
  }
}
