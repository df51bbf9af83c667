/** Sliders and fields of all that is given, by section. */

import { make } from "./elements";
import { type Given, type Mechanism, type Values, givenValue } from "./tables";
import { called, digits } from "./words";

/** Sections that are open at first. */
const OPEN = ["Dimensions", "Drive and loads"];
/** The section whose amounts a drag changes, but for those that are locked. */
const LOCKABLE = "Dimensions";
const KEPT = "A drag leaves a dimension with a tick as it is";
/** What is written in a field: no digit before the point is lost. */
const written = (value: number): string => digits(value, Math.abs(value) >= 1e5 ? 6 : 5);
const ORDER = ["Dimensions", "Drive and loads", "Spring, damper, friction", "Masses", "Gravity", "Start"];

export interface Listener {
  change(name: string, value: number, done: boolean): void;
  lock(name: string, locked: boolean): void;
}

interface Row {
  given: Given;
  line: HTMLElement;
  update: (value: number, all?: boolean) => void;
}

/** The range of a slider, in SI. */
function range(given: Given, value: number): [number, number] {
  if (given.unit === "deg") {
    // some sources count to a whole turn
    const turn = 2 * Math.PI;
    return [value < -Math.PI ? -turn : value > Math.PI ? 0 : -Math.PI, value > Math.PI ? turn : Math.PI];
  }
  const size = 2.5 * Math.max(Math.abs(value), Math.abs(given.start)) || 10 * (given.nominal ?? 0);
  const round = size > 0 ? 10 ** Math.floor(Math.log10(size)) : 1;
  const most = Math.ceil(size / round) * round || 1;
  return [given.least === undefined ? -most : given.least, most];
}

export class Panel {
  private rows: Row[] = [];
  private readonly locks = new Map<string, HTMLInputElement>();

  constructor(
    private readonly place: HTMLElement,
    private readonly listener: Listener,
  ) {}

  show(mechanism: Mechanism, values: Values, locks: string[]): void {
    this.place.replaceChildren();
    this.rows = [];
    this.locks.clear();
    const sections = [...new Set(mechanism.given.map((g) => g.section))];
    sections.sort((a, b) => ORDER.indexOf(a) - ORDER.indexOf(b));
    for (const name of sections) {
      const open = OPEN.includes(name);
      const box = make("details", { open }, make("summary", { textContent: name }));
      // over the boxes that lock a dimension
      const lock = make("span", { className: "heading", textContent: "lock", title: KEPT });
      if (name === LOCKABLE) box.append(make("div", { className: "row" }, lock));
      for (const given of mechanism.given.filter((g) => g.section === name))
        box.append(this.row(given, givenValue(given, values), locks.includes(given.name)));
      this.place.append(box);
    }
    this.hide(values);
  }

  /** Show values; `all`: in the field too in which someone is. */
  update(values: Values, all = false): void {
    for (const { given, update } of this.rows) update(givenValue(given, values), all);
    this.hide(values);
  }

  /** Of a state that comes back: which dimensions are locked. */
  lock(locks: string[]): void {
    for (const [name, lock] of this.locks) lock.checked = locks.includes(name);
  }

  /** Inputs that do not act, because their freedom is driven otherwise, are not shown. */
  private hide(values: Values): void {
    for (const { given: mode } of this.rows)
      if (mode.arguments) {
        const acting = mode.arguments[givenValue(mode, values)];
        for (const { given, line } of this.rows)
          if (given.argument && mode.arguments.includes(given.argument))
            line.classList.toggle("idle", given.argument !== acting);
      }
  }

  private row(given: Given, value: number, locked: boolean): HTMLElement {
    const htmlFor = `field ${given.name}`;
    const label = make("label", { textContent: called(given), title: given.text, htmlFor });
    const line = make("div", { className: "row" }, label);
    if (given.choices) this.choice(line, given, value);
    else this.number(line, given, value, locked);
    return line;
  }

  private choice(line: HTMLElement, given: Given, value: number): void {
    const options = Object.entries(given.choices!).map(([key, words]) => new Option(words, key));
    const select = make("select", { id: `field ${given.name}` }, ...options);
    select.value = String(value);
    select.addEventListener("change", () => this.listener.change(given.name, Number(select.value), true));
    line.append(select);
    this.rows.push({ given, line, update: (now) => (select.value = String(now)) });
  }

  private number(line: HTMLElement, given: Given, value: number, locked: boolean): void {
    const slider = make("input", { type: "range", step: "any", "aria-label": `${called(given)}, slider` });
    const id = `field ${given.name}`;
    const field = make("input", { type: "number", step: "any", id, title: given.text });
    const unit = make("span", { className: "unit", textContent: given.unit });
    let current = Number.NaN;
    const update = (now: number, all = false): void => {
      if (now === current && !all) return;
      current = now;
      if (document.activeElement !== slider) {
        const [least, most] = range(given, now);
        slider.min = String(least);
        slider.max = String(most);
      }
      slider.value = String(now);
      slider.setAttribute("aria-valuetext", `${digits(now * given.factor)} ${given.unit}`);
      if (all || document.activeElement !== field) field.value = written(now * given.factor);
      field.dataset.value = String(now);
    };
    slider.addEventListener("input", () => this.listener.change(given.name, Number(slider.value), false));
    slider.addEventListener("change", () => {
      this.listener.change(given.name, Number(slider.value), true);
      update(current, true);
    });
    // what was refused is shown no longer
    field.addEventListener("change", () => {
      if (field.value !== "") this.listener.change(given.name, Number(field.value) / given.factor, true);
      update(current, true);
    });
    line.append(slider, field, unit);
    if (given.section === LOCKABLE) line.append(this.locker(given, locked));
    this.rows.push({ given, line, update });
    update(value);
  }

  private locker(given: Given, locked: boolean): HTMLElement {
    const name = `${called(given)}: lock. ${KEPT}`;
    const lock = make("input", { type: "checkbox", checked: locked, title: KEPT, "aria-label": name });
    this.locks.set(given.name, lock);
    lock.addEventListener("change", () => this.listener.lock(given.name, lock.checked));
    return lock;
  }
}
