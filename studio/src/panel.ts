/** Sliders and fields of all that is given, by section. */

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
      const box = document.createElement("details");
      box.open = OPEN.includes(name);
      const head = document.createElement("summary");
      head.textContent = name;
      box.append(head);
      if (name === LOCKABLE) box.append(this.heading());
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

  /** Over the boxes that lock a dimension. */
  private heading(): HTMLElement {
    const line = document.createElement("div");
    line.className = "row";
    const words = document.createElement("span");
    words.className = "heading";
    words.textContent = "lock";
    words.title = KEPT;
    line.append(words);
    return line;
  }

  private row(given: Given, value: number, locked: boolean): HTMLElement {
    const line = document.createElement("div");
    line.className = "row";
    const label = document.createElement("label");
    label.textContent = called(given);
    label.title = given.text;
    label.htmlFor = `field ${given.name}`;
    line.append(label);
    if (given.choices) this.choice(line, given, value);
    else this.number(line, given, value, locked);
    return line;
  }

  private choice(line: HTMLElement, given: Given, value: number): void {
    const select = document.createElement("select");
    select.id = `field ${given.name}`;
    for (const [key, words] of Object.entries(given.choices!)) select.add(new Option(words, key));
    select.value = String(value);
    select.addEventListener("change", () => this.listener.change(given.name, Number(select.value), true));
    line.append(select);
    this.rows.push({ given, line, update: (now) => (select.value = String(now)) });
  }

  private number(line: HTMLElement, given: Given, value: number, locked: boolean): void {
    const [slider, field] = [document.createElement("input"), document.createElement("input")];
    slider.type = "range";
    slider.step = "any";
    slider.setAttribute("aria-label", `${called(given)}, slider`);
    field.type = "number";
    field.step = "any";
    field.id = `field ${given.name}`;
    field.title = given.text;
    const unit = document.createElement("span");
    unit.className = "unit";
    unit.textContent = given.unit;
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
    const lock = document.createElement("input");
    this.locks.set(given.name, lock);
    lock.type = "checkbox";
    lock.checked = locked;
    lock.title = KEPT;
    lock.setAttribute("aria-label", `${called(given)}: lock. ${KEPT}`);
    lock.addEventListener("change", () => this.listener.lock(given.name, lock.checked));
    return lock;
  }
}
