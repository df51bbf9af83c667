/** The studio: a state, what follows from it, and the parts of the page that show both. */

import { Backdrop } from "./backdrop";
import { bytesOf, Core, type Rows } from "./core";
import { dxfText } from "./dxf";
import { Embed } from "./embed";
import { caseText, linkOf, parameterText, pixels, pythonText, save, stateIn, tableText } from "./exports";
import { History } from "./history";
import { Panel } from "./panel";
import { Picture } from "./picture";
import { WithPython } from "./python";
import { Solver } from "./solver";
import {
  type Given,
  givenOf,
  type Mechanism,
  outputAt,
  rowLength,
  type Source,
  type State,
  type Tables,
} from "./tables";
import { digits, motionInWords, multiplierInWords, shown, verdictInWords } from "./words";
import { Views } from "./views";
import type { Answer } from "./worker";

/** Steps of a turn and of a run between whose rows the page moves. */
const TURN_STEPS = 720;
const RUN_STEPS = 1440;
const TURNS_OF_A_RUN = 6;
const RATES = [1, 1 / 2, 1 / 5, 1 / 10, 1 / 20, 1 / 50, 1 / 100];

/** Views by their keys. */
const LOOKS: Record<string, string> = {
  "-": "smaller",
  "+": "larger",
  "0": "all",
  "1": "front",
  "2": "top",
  "3": "side",
  "4": "isometric",
};

const by = <T extends Element>(id: string): T => document.getElementById(id) as unknown as T;
const stored = <T>(id: string): T => JSON.parse(by<HTMLElement>(id).textContent ?? "") as T;

class Studio {
  readonly tables = stored<Tables>("tables");
  state: State = stored<State>("state");
  private mechanism!: Mechanism;
  private core!: Core;
  /** What the worker answered last, and which row of it is drawn. */
  private answer: Answer | undefined;
  private row = 0;
  private time = 0;
  private moving = true;
  /** The configuration of a drag, which stays as it is while the motion about it changes. */
  private held: Float64Array | undefined;
  private history!: History<State>;
  private readonly picture = new Picture(by<SVGSVGElement>("picture"), by("behind"), by("markers"));
  private readonly view = this.picture.view;
  private readonly backdrop = new Backdrop(
    by<HTMLElement>("backdrop"),
    by<SVGGElement>("behind"),
    by<SVGGElement>("markers"),
    this.view,
    {
      change: (behind, done) => this.put({ ...this.state, behind }, done, false),
      fault: (sentence) => this.fault(sentence),
    },
  );
  readonly charts = new Views(
    by<HTMLElement>("charts"),
    (values, start) => this.change(values, true, start),
    this.tables.tolerance,
  );
  private readonly panel = new Panel(by<HTMLElement>("panel"), {
    change: (name, value, done) => this.change({ [name]: value }, done),
    lock: (name, locked) => {
      const others = (this.state.locks ?? []).filter((lock) => lock !== name);
      this.put({ ...this.state, locks: locked ? [...others, name] : others }, true);
    },
  });
  private embed!: Embed;
  private readonly solver = new Solver((answer, newest) => this.answered(answer, newest));
  private readonly python = new WithPython(by<HTMLElement>("python"), this.view, {
    state: () => ({ ...this.state, duration: this.duration() }),
    take: (state) => this.take(state),
    rows: () => this.answer?.rows,
  });
  private numbers: HTMLTableCellElement[] = [];

  async start(): Promise<void> {
    this.wire();
    let wrong = "";
    try {
      this.state = stateIn(location.href, this.tables) ?? this.state;
    } catch (error) {
      wrong = (error as Error).message;
    }
    this.history = new History<State>(JSON.stringify(this.state));
    await this.open(this.state);
    if (wrong) this.fault(wrong);
    this.embed = new Embed(
      this.tables,
      (state) => this.take(state),
      (sentence) => this.fault(sentence),
    );
    let last = performance.now();
    const frame = (now: number): void => {
      this.advance((now - last) / 1000);
      last = now;
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  /** Show a state, of whichever mechanism. */
  private async open(state: State): Promise<void> {
    const mechanism = this.tables.mechanisms.find((m) => m.name === state.mechanism);
    if (!mechanism) throw new Error(`there is no mechanism ${state.mechanism}`);
    const { view, ...kept } = state;
    this.state = kept;
    if (mechanism !== this.mechanism) {
      const bytes = await bytesOf(mechanism);
      this.core = await Core.make(mechanism, bytes);
      await this.solver.use(mechanism, bytes);
      this.mechanism = mechanism;
      this.answer = undefined;
      this.row = 0;
      this.time = 0;
      this.picture.show(mechanism);
      by("views").classList.toggle("planar", mechanism.picture.planar);
      this.charts.show(mechanism, state.source ?? "steady", bytes);
      this.python.show(mechanism, state);
      this.panel.show(mechanism, state.values, state.locks ?? []);
      this.listNumbers();
    } else {
      this.panel.update(state.values, true);
      this.panel.lock(state.locks ?? []);
    }
    if (view) this.view.show(mechanism.picture.planar, view);
    this.backdrop.show(state.behind);
    const { values, count, sentence } = this.begin();
    if (!this.answer && count > 0) {
      // there is something to see before the first motion is known
      this.picture.fit(values);
      this.picture.draw(values, (reference) => this.has(reference));
    }
    this.fault(sentence);
    this.compute();
    this.name();
    this.embed?.tell(this.state);
  }

  /** The links at the start, from what is given, with the sentence where they cannot be joined. */
  private begin(): Rows {
    this.core.give(givenOf(this.mechanism, this.state.values));
    return this.core.run(1, 0);
  }

  private compute(start?: number[]): void {
    const m = this.mechanism;
    const duration = this.duration();
    this.solver.ask({
      start,
      given: givenOf(m, this.state.values),
      source: this.state.source ?? "steady",
      step: duration / RUN_STEPS,
      count: RUN_STEPS,
      turnSteps: TURN_STEPS,
    });
  }

  /** Of a run from the start (s): some turns at the speed that the crank has at the start. */
  private duration(): number {
    if (this.state.duration) return this.state.duration;
    const m = this.mechanism;
    if (m.crank < 0) return 5;
    const freedom = m.freedoms[m.crank];
    const speed = m.given
      .filter((g) => g.freedom === m.crank && g.arguments === undefined)
      .filter((g) => g.unit === "rpm" || g.unit === "rad/s")
      .map((g) => this.value(g))
      .concat(m.given.filter((g) => g.reference === freedom.initial[1]).map((g) => this.value(g)))
      .find((value) => Math.abs(value) > 1e-6);
    return speed ? (TURNS_OF_A_RUN * freedom.period) / Math.abs(speed) : 5;
  }

  private value(given: Given): number {
    return this.state.values[given.name] ?? given.start;
  }

  private answered(answer: Answer, newest: boolean): void {
    const first = this.answer === undefined;
    const kept = this.answer?.source === answer.source ? this.share() : 0;
    if (answer.rows.values.length % rowLength(this.mechanism) !== 0) return;
    this.answer = answer;
    if (answer.rows.count > 0) {
      if (!this.held) {
        this.time = kept * this.length();
        if (newest) {
          this.picture.fit(answer.rows.values);
          this.backdrop.draw();
          this.python.draw();
        }
      }
      this.picture.drawPaths(answer.rows.values);
      this.charts.data(answer.rows, answer.source);
      by<HTMLInputElement>("scrub").max = String(answer.rows.count - 1);
    }
    by("words").textContent = motionInWords(this.mechanism, answer.rows, answer.source, answer.orbit);
    this.floquet(answer);
    if (newest && !this.held) this.see(answer);
    this.seek(this.nearest());
    if (first) document.documentElement.dataset.ready = String(Math.round(performance.now()));
    document.documentElement.dataset.answer = String(answer.id);
    document.documentElement.dataset.settled = String(newest);
  }

  /** Let the charts that take longer see the motion that the page has come to. */
  private see({ orbit }: Answer): void {
    const m = this.mechanism;
    let natural = Number.NaN;
    if (m.natural !== null) {
      this.core.give(givenOf(m, this.state.values));
      natural = this.core.natural(m.natural);
    }
    this.charts.see({ mechanism: m, values: this.state.values, orbit, natural });
  }

  private floquet({ orbit, milliseconds }: Answer): void {
    const verdict = verdictInWords(orbit, this.tables.tolerance);
    const place = by<HTMLElement>("floquet");
    place.replaceChildren("Periodic motion: ");
    const word = document.createElement("b");
    word.textContent = verdict;
    word.className = verdict === "unstable" || !orbit.found ? "unstable" : "";
    place.append(word);
    if (orbit.size > 0)
      place.append(`; Floquet multipliers ${orbit.multipliers.map(multiplierInWords).join(", ")}`);
    place.title = `computed in ${digits(milliseconds, 2)} ms`;
    place.dataset.multipliers = JSON.stringify(orbit.multipliers);
  }

  // The instant that is drawn

  private length(): number {
    const rows = this.answer?.rows;
    return rows && rows.count > 0 ? rows.values[(rows.count - 1) * rowLength(this.mechanism)] : 0;
  }

  private share(): number {
    return this.length() > 0 ? this.time / this.length() : 0;
  }

  /** The row nearest to the time. */
  private nearest(): number {
    const { values, count } = this.answer!.rows;
    const length = rowLength(this.mechanism);
    let [low, high] = [0, count - 1];
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (values[middle * length] <= this.time) low = middle;
      else high = middle;
    }
    if (high < 0) return 0;
    return values[high * length] - this.time < this.time - values[low * length] ? high : low;
  }

  private advance(seconds: number): void {
    if (!this.answer || !this.moving || this.held || this.answer.rows.count === 0) return;
    const length = this.length();
    if (length === 0) return;
    this.time = (this.time + seconds * Number(by<HTMLSelectElement>("rate").value)) % length;
    this.seek(this.nearest());
  }

  /** Draw a row, with its numbers. */
  seek(row: number): void {
    const rows = this.answer?.rows;
    if (!rows || rows.count === 0) return;
    this.row = Math.max(0, Math.min(rows.count - 1, row));
    const length = rowLength(this.mechanism);
    const values = this.held ?? rows.values.subarray(this.row * length, (this.row + 1) * length);
    this.picture.draw(values, (reference) => this.has(reference));
    this.charts.mark(this.row);
    by<HTMLInputElement>("scrub").value = String(this.row);
    this.writeNumbers(values);
  }

  private has(reference: number): boolean {
    const given = this.mechanism.given.find((g) => g.reference === reference);
    return given !== undefined && this.value(given) !== 0;
  }

  /** The table of all outputs at the instant that is drawn. */
  private listNumbers(): void {
    const box = document.createElement("details");
    const head = document.createElement("summary");
    head.textContent = "Numbers at this instant";
    const table = document.createElement("table");
    this.numbers = this.mechanism.outputs.map((output) => {
      const line = table.insertRow();
      line.insertCell().textContent = output.name;
      line.title = output.text;
      return line.insertCell();
    });
    box.append(head, table);
    box.id = "numbers";
    by("panel").append(box);
  }

  private writeNumbers(row: Float64Array): void {
    const m = this.mechanism;
    const crank = m.crank >= 0 ? m.outputs[m.freedoms[m.crank].coordinate] : undefined;
    const angle = crank ? row[outputAt(m, m.freedoms[m.crank].coordinate)] : 0;
    by("instant").textContent =
      `t = ${row[0].toFixed(4)} s${crank ? `, crank at ${((angle * 180) / Math.PI).toFixed(1)} deg` : ""}`;
    if (!by<HTMLDetailsElement>("numbers").open) return;
    m.outputs.forEach((output, n) => {
      const value = row[outputAt(m, n)];
      this.numbers[n].textContent = shown(value, output, 6);
      this.numbers[n].dataset.value = String(value);
    });
  }

  // Changes

  /** Put another state; `done` when it is to be undone as one step. */
  private put(state: State, done: boolean, computed = true, start?: number[]): void {
    this.state = state;
    this.panel.update(state.values);
    if (done) {
      this.history.keep(state);
      this.embed.tell(state);
    }
    this.name();
    if (computed) this.compute(start);
  }

  /** Change what is given, where the links can be joined then; else all stays, and the page says why. */
  private change(values: Record<string, number>, done: boolean, start?: number[]): void {
    const last = this.state;
    this.state = { ...last, values: { ...last.values, ...values } };
    const { sentence } = this.begin();
    this.fault(sentence);
    if (sentence) {
      this.state = last;
      this.panel.update(last.values);
      if (done) this.history.keep(last);
    } else this.put(this.state, done, true, start);
  }

  /** Keep the configuration that is drawn. */
  private hold(): void {
    const rows = this.answer?.rows;
    const length = rowLength(this.mechanism);
    if (rows?.count) this.held ??= rows.values.slice(this.row * length, (this.row + 1) * length);
  }

  private drag(joint: number, target: [number, number], done: boolean): void {
    const m = this.mechanism;
    this.hold();
    if (!this.held) return;
    const moves = m.picture.joints[joint].moves;
    const names = new Map(m.given.map((g) => [g.reference, g.name]));
    const free = moves.filter((reference) => !(this.state.locks ?? []).includes(names.get(reference)!));
    // the configuration that is drawn is the start of what is dragged
    const start = m.freedoms.flatMap((f): [number, number][] => [
      [f.initial[0], this.held![outputAt(m, f.coordinate)]],
      [f.initial[1], this.held![outputAt(m, f.rate)]],
    ]);
    this.core.give([...givenOf(m, this.state.values), ...start]);
    const { values: row, sentence } = free.length
      ? this.core.drag(joint, free, this.view.matrix.slice(0, 6), target)
      : { values: this.held, sentence: `${moves.map((r) => names.get(r)).join(" and ")} locked` };
    this.fault(sentence);
    this.held = row;
    const initial = new Set(start.map(([reference]) => reference));
    const pulled = free.length > 0 && free.every((reference) => initial.has(reference));
    const moved = pulled ? start.map(([reference]) => reference) : free.filter((r) => !initial.has(r));
    const values = Object.fromEntries(moved.map((r) => [names.get(r)!, this.core.given(r)]));
    const source: Source = pulled ? "run" : (this.state.source ?? "steady");
    const state: State = { ...this.state, source, values: { ...this.state.values, ...values } };
    if (done) {
      this.time = pulled ? 0 : this.resumed(row);
      this.held = undefined;
      by<HTMLSelectElement>("source").value = source;
    }
    this.put(state, done);
    this.seek(this.row);
  }

  /** When the motion comes to the crank angle of a row: the rows of a turn are at equal steps of it. */
  private resumed(row: Float64Array): number {
    const m = this.mechanism;
    if (m.crank < 0 || this.answer!.source !== "steady") return this.time;
    const freedom = m.freedoms[m.crank];
    const turns = row[outputAt(m, freedom.coordinate)] / freedom.period;
    const { values, count } = this.answer!.rows;
    return values[Math.round((turns - Math.floor(turns)) * (count - 1)) * rowLength(m)];
  }

  /** Show a state that comes from elsewhere, as a step that can be undone. */
  private take(state: State): void {
    this.history.keep(state);
    void this.restore(state);
  }

  /** Show another state; for scripts too. */
  async restore(state: State | undefined): Promise<void> {
    if (!state) return;
    await this.open(state);
    by<HTMLSelectElement>("source").value = state.source ?? "steady";
  }

  /** The other assembly: the first sign that says how the links are joined. */
  private assemble(): void {
    const sign = this.mechanism.given.find((g) => g.choices && "-1" in g.choices);
    if (sign) this.change({ [sign.name]: -this.value(sign) }, true);
  }

  private fault(sentence: string): void {
    const place = by<HTMLElement>("fault");
    if (place.textContent !== sentence) place.textContent = sentence;
  }

  private name(): void {
    by("title").textContent = this.state.title;
    const { name, given, sets } = this.mechanism;
    const set = sets.find(({ values }) => given.every((g) => (values[g.name] ?? g.start) === this.value(g)));
    by<HTMLSelectElement>("set").value = set ? `${name}/${set.name}` : "";
    by<HTMLButtonElement>("undo").disabled = !this.history.canUndo;
    by<HTMLButtonElement>("redo").disabled = !this.history.canRedo;
  }

  // The page

  private play(moving: boolean): void {
    this.moving = moving;
    by("play").textContent = moving ? "Pause" : "Move";
  }

  private theme(dark: boolean): void {
    document.documentElement.dataset.theme = dark ? "dark" : "light";
    if (this.answer) {
      this.charts.show(this.mechanism, this.answer.source);
      this.charts.data(this.answer.rows, this.answer.source);
    }
  }

  private wire(): void {
    this.theme(matchMedia("(prefers-color-scheme: dark)").matches);
    this.picture.onGrab = () => this.hold();
    this.picture.onDrag = (joint, target, done) => this.drag(joint, target, done);
    this.view.onChange = () => {
      this.backdrop.draw();
      this.python.draw();
      if (!this.answer) return;
      this.picture.drawPaths(this.answer.rows.values);
      this.seek(this.row);
    };
    new ResizeObserver(() => {
      if (!this.answer) return;
      this.picture.fit(this.answer.rows.values);
      this.view.onChange();
    }).observe(by("picture"));
    const rate = by<HTMLSelectElement>("rate");
    for (const value of RATES) rate.add(new Option(value === 1 ? "1" : `1/${1 / value}`, String(value)));
    rate.value = String(1 / 10);
    const sets = by<HTMLSelectElement>("set");
    sets.add(new Option("values of its own", ""));
    for (const m of this.tables.mechanisms)
      for (const { name, source } of m.sets) {
        const option = new Option(`${m.title}: ${name}`, `${m.name}/${name}`);
        option.title = source;
        sets.add(option);
      }
    sets.addEventListener("change", () => {
      const [mechanism, name] = sets.value.split("/");
      const set = this.tables.mechanisms.find((m) => m.name === mechanism)?.sets.find((s) => s.name === name);
      if (!set) return;
      this.take({ mechanism, title: set.source, values: { ...set.values } });
    });
    const actions: Record<string, () => void> = {
      play: () => this.play(!this.moving),
      undo: () => void this.restore(this.history.undo()),
      redo: () => void this.restore(this.history.redo()),
      assembly: () => this.assemble(),
      theme: () => this.theme(document.documentElement.dataset.theme !== "dark"),
    };
    for (const [id, action] of Object.entries(actions)) by(id).addEventListener("click", action);
    for (const button of document.querySelectorAll<HTMLElement>("[data-look]"))
      button.addEventListener("click", () => this.look(button.dataset.look!));
    addEventListener("hashchange", () => {
      try {
        const state = stateIn(location.href, this.tables);
        if (state) this.take(state);
      } catch (error) {
        this.fault((error as Error).message);
      }
    });
    const choice = by<HTMLSelectElement>("save");
    choice.addEventListener("change", () => {
      void this.save(choice.value);
      choice.value = "";
    });
    by("scrub").addEventListener("input", () => {
      this.play(false);
      this.go(Number(by<HTMLInputElement>("scrub").value));
    });
    by("source").addEventListener("change", () =>
      this.put({ ...this.state, source: by<HTMLSelectElement>("source").value as Source }, true),
    );
    by("panel").addEventListener("toggle", () => this.seek(this.row), true);
    addEventListener("keydown", (event) => this.key(event, actions));
  }

  private look(name: string): void {
    if (name === "larger") this.view.larger();
    else if (name === "smaller") this.view.smaller();
    else {
      this.view.look(name);
      if (this.answer) this.picture.fit(this.answer.rows.values);
      this.view.onChange();
    }
  }

  /** Save what is shown, in one of the forms of the list. */
  private async save(form: string): Promise<void> {
    const m = this.mechanism;
    const rows = this.answer?.rows;
    const text = (content: string, type: string): Blob => new Blob([content], { type });
    if (form === "case")
      save("case.toml", text(caseText(m, this.state, this.duration()), "application/toml"));
    else if (form === "python")
      save("case.py", text(pythonText(m, this.state, this.duration(), this.answer?.orbit), "text/x-python"));
    else if (form === "ssv") save("parameters.ssv", text(parameterText(m, this.state), "application/xml"));
    else if (form === "dxf") save("drawing.dxf", text(dxfText(this.picture.drawn()), "image/vnd.dxf"));
    else if (form === "table" && rows) save("motion.csv", text(tableText(m, rows), "text/csv"));
    else if (form === "svg") save("drawing.svg", text(this.picture.svgText(), "image/svg+xml"));
    else if (form === "png") {
      const { width, height } = by<SVGSVGElement>("picture").getBoundingClientRect();
      const back = getComputedStyle(document.body).getPropertyValue("--card");
      save("drawing.png", await pixels(this.picture.svgText(), width, height, back));
    } else if (form === "link") {
      history.replaceState(null, "", linkOf({ ...this.state, view: this.view.kept }));
      this.fault("");
      by("words").textContent = "The address of this page now holds its state: copy it.";
    }
  }

  /** Go to a row, and on from there. */
  go(row: number): void {
    if (!this.answer) return;
    this.seek(row);
    this.time = this.answer.rows.values[this.row * rowLength(this.mechanism)];
  }

  private key(event: KeyboardEvent, actions: Record<string, () => void>): void {
    const typing = event.target instanceof Element && event.target.matches("input, select, textarea");
    const control = event.ctrlKey || event.metaKey;
    let action: (() => void) | undefined;
    if (control && event.key.toLowerCase() === "z") action = event.shiftKey ? actions.redo : actions.undo;
    else if (control && event.key.toLowerCase() === "y") action = actions.redo;
    else if (!typing && !control && !event.altKey)
      action = {
        " ": (event.target as Element).matches("button, summary, a") ? undefined : actions.play,
        a: actions.assembly,
        l: actions.theme,
        ",": () => this.step(-1),
        ".": () => this.step(1),
        ...Object.fromEntries(Object.entries(LOOKS).map(([key, name]) => [key, () => this.look(name)])),
      }[event.key];
    if (!action) return;
    event.preventDefault();
    action();
  }

  private step(by: number): void {
    this.play(false);
    this.go(this.row + by);
  }

  /** For scripts: the rows that are shown, and which of them is drawn. */
  shown(): { rows: Rows; row: number; source: Source; answer: Answer } | undefined {
    return (
      this.answer && {
        rows: this.answer.rows,
        row: this.row,
        source: this.answer.source,
        answer: this.answer,
      }
    );
  }
}

declare global {
  interface Window {
    studio: Studio;
  }
}

window.studio = new Studio();
void window.studio.start();
