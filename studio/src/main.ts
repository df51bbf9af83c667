/** The studio: a state, what follows from it, and the parts of the page that show both. */

import { Backdrop } from "./backdrop";
import { Solver } from "./background";
import { by, Controls } from "./controls";
import { moduleBytes, Core } from "./core";
import type { Rows } from "./motions";
import { Embed } from "./embed";
import { pageAddress, saveAs, readState } from "./exports";
import { History } from "./history";
import { Numbers } from "./numbers";
import { Panel } from "./panel";
import { Picture } from "./picture";
import { Playback } from "./playback";
import { WithPython } from "./python";
import {
  type Given,
  allGiven,
  jointPlace,
  type Mechanism,
  outputPlace,
  rowLength,
  type Source,
  type State,
  type Tables,
  type Values,
  givenValue,
} from "./tables";
import { called, capital, motionInWords, roundingSizes } from "./words";
import { Views } from "./views";
import type { Answer } from "./worker";

/** Steps of a turn and of a run between whose rows the page moves. */
const TURN_STEPS = 720;
const RUN_STEPS = 1440;
const TURNS_OF_A_RUN = 6;
/** How near to its place a joint need not be moved (px). */
const NEAR = 1e-6;

const stored = <T>(id: string): T => JSON.parse(by<HTMLElement>(id).textContent ?? "") as T;

class Studio {
  readonly tables = stored<Tables>("tables");
  state: State = stored<State>("state");
  private mechanism!: Mechanism;
  private core!: Core;
  private readonly playback = new Playback();
  /** The configuration of a drag, which stays as it is while the motion about it changes; whether its start is pulled. */
  private held: Float64Array | undefined;
  private pulled = false;
  private history = new History<State>(JSON.stringify(this.state));
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
  private readonly solver = new Solver(
    (answer, newest) => this.answered(answer, newest),
    (sentence) => this.fault(capital(sentence)),
  );
  private readonly python = new WithPython(by<HTMLElement>("python"), this.view, {
    state: () => ({ ...this.state, duration: this.duration() }),
    take: (state) => this.take(state),
    rows: () => this.playback.answer?.rows,
  });
  private readonly numbers = new Numbers();
  private readonly controls = new Controls(this.tables, {
    undo: () => void this.restore(this.history.undo()),
    redo: () => void this.restore(this.history.redo()),
    assembly: () => this.assemble(),
    theme: () => this.theme(document.documentElement.dataset.theme !== "dark"),
    play: () => this.play(!this.playback.moving),
    look: (name) => this.look(name),
    step: (rows) => this.pause(this.playback.row + rows),
    go: (row) => this.pause(row),
    choose: (source) => this.put({ ...this.state, source }, true),
    save: (form) => void this.save(form),
    take: (state) => void this.take(state),
  });

  async start(): Promise<void> {
    this.wire();
    const { mechanism } = this.state;
    const starts: State[] = [this.state, { mechanism, title: "", values: {} }];
    let said = "";
    try {
      const given = readState(location.href, this.tables);
      if (given) starts.unshift(given);
    } catch (error) {
      said = (error as Error).message;
    }
    // what cannot be shown is said, and something else is shown below it
    for (const state of starts) {
      const wrong = await this.open(state);
      if (!wrong) break;
      said ||= wrong;
    }
    this.history = new History<State>(JSON.stringify(this.state));
    this.name();
    this.fault(said);
    this.embed = new Embed(
      this.tables,
      (state) => void this.take(state),
      (sentence) => this.fault(sentence),
    );
    let last = performance.now();
    const frame = (now: number): void => {
      const seconds = ((now - last) / 1000) * this.controls.speed;
      if (!this.held && this.playback.advance(seconds)) this.seek(this.playback.nearest());
      last = now;
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  /** Show a state, of whichever mechanism; where it cannot begin all stays, and the sentence says why. */
  private async open(state: State): Promise<string> {
    const mechanism = this.tables.mechanisms.find((m) => m.name === state.mechanism);
    if (!mechanism) throw new Error(`there is no mechanism ${state.mechanism}`);
    const bytes = mechanism === this.mechanism ? undefined : await moduleBytes(mechanism);
    const core = bytes ? await Core.make(mechanism, bytes) : this.core;
    const { values, sentence } = this.begin(core, mechanism, state);
    this.fault(capital(sentence));
    if (sentence) return capital(sentence);
    const { view, ...kept } = state;
    this.state = kept;
    if (bytes) {
      this.core = core;
      this.solver.use(mechanism, bytes);
      this.mechanism = mechanism;
      this.playback.show(mechanism);
      this.picture.show(mechanism);
      by("views").classList.toggle("planar", mechanism.picture.planar);
      this.charts.show(mechanism, state.source ?? "steady", bytes);
      this.python.show(mechanism, state);
      this.panel.show(mechanism, state.values, state.locks ?? []);
      this.numbers.show(mechanism, by("panel"));
    } else {
      this.panel.update(state.values, true);
      this.panel.lock(state.locks ?? []);
    }
    if (view) this.view.show(mechanism.picture.planar, view);
    this.backdrop.show(state.behind);
    if (!this.playback.answer) {
      // there is something to see before the first motion is known
      this.picture.fit(values);
      this.picture.draw(values, (reference) => this.has(reference));
    }
    this.compute();
    this.name();
    this.embed?.tell(this.state);
    return "";
  }

  /** The links at the start, with the sentence where they cannot be joined. */
  private begin(core: Core, mechanism: Mechanism, { values }: State): Rows {
    core.give(allGiven(mechanism, values));
    return core.run(1, 0);
  }

  private compute(start?: number[]): void {
    const m = this.mechanism;
    const duration = this.duration();
    this.solver.ask({
      start,
      given: allGiven(m, this.state.values),
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
    return givenValue(given, this.state.values);
  }

  private answered(answer: Answer, newest: boolean): void {
    const m = this.mechanism;
    const { playback } = this;
    const first = playback.answer === undefined;
    const { rows, source, orbit } = answer;
    const kept = playback.answer?.source === source ? playback.share : 0;
    if (rows.values.length % rowLength(m) !== 0) return;
    playback.answer = answer;
    if (rows.count > 0) {
      if (!this.held) {
        playback.time = kept * playback.length;
        if (newest) {
          this.picture.fit(rows.values);
          this.backdrop.draw();
          this.python.draw();
        }
      }
      this.picture.drawPaths(rows.values);
      this.charts.data(rows, source);
    }
    by("words").textContent = motionInWords(m, rows, orbit, this.state.values);
    this.controls.motion(answer);
    if (newest && !this.held) this.see(answer);
    this.seek(playback.nearest());
    if (first) document.documentElement.dataset.ready = String(Math.round(performance.now()));
    document.documentElement.dataset.answer = String(answer.id);
    document.documentElement.dataset.settled = String(newest);
  }

  /** Let the charts that take longer see the motion that the page has come to. */
  private see({ orbit }: Answer): void {
    const m = this.mechanism;
    let natural = Number.NaN;
    if (m.natural !== null) {
      this.core.give(allGiven(m, this.state.values));
      natural = this.core.natural(m.natural);
    }
    this.charts.see({ mechanism: m, values: this.state.values, orbit, natural });
  }

  // The instant that is drawn

  /** Draw a row, with its numbers. */
  seek(row: number): void {
    const { playback } = this;
    if (playback.count === 0) return;
    playback.row = Math.max(0, Math.min(playback.count - 1, row));
    const values = this.held ?? playback.valuesOf(playback.row);
    this.picture.draw(values, (reference) => this.has(reference));
    this.charts.mark(playback.row);
    this.controls.show(playback);
    this.tell(values);
  }

  private has(reference: number): boolean {
    const given = this.mechanism.given.find((g) => g.reference === reference);
    return given !== undefined && this.value(given) !== 0;
  }

  private tell(row: Float64Array): void {
    const m = this.mechanism;
    const angle = m.crank < 0 ? 0 : row[outputPlace(m, m.freedoms[m.crank].coordinate)];
    const crank = m.crank < 0 ? "" : `, crank at ${((angle * 180) / Math.PI).toFixed(1)} deg`;
    by("instant").textContent = `t = ${row[0].toFixed(4)} s${crank}`;
    const { rows, source } = this.playback.answer!;
    this.numbers.write(row, roundingSizes(m, rows), source);
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
    const state = { ...this.state, values: { ...this.state.values, ...values } };
    const { sentence } = this.begin(this.core, this.mechanism, state);
    this.fault(capital(sentence));
    if (!sentence) this.put(state, done, true, start);
    else {
      this.panel.update(this.state.values);
      if (done) this.history.keep(this.state);
      this.name();
    }
  }

  /** Keep the configuration that is drawn. */
  private hold(): void {
    if (this.playback.count === 0 || this.held) return;
    this.held = this.playback.valuesOf(this.playback.row).slice();
    this.pulled = false;
  }

  private drag(joint: number, target: [number, number], done: boolean): void {
    this.hold();
    if (!this.held) return;
    const state = this.pull(joint, target, this.held);
    if (done) {
      this.playback.time = this.pulled ? 0 : this.playback.resumed(this.held);
      this.held = undefined;
    }
    if (state || done) this.put(state ?? this.state, done);
    this.seek(this.playback.row);
  }

  /** The state in which a joint comes to a place, as far as the links let it; none where nothing moves. */
  private pull(joint: number, target: [number, number], held: Float64Array): State | undefined {
    const m = this.mechanism;
    const at = jointPlace(m, joint);
    const [x, y] = this.view.seen(held[at], held[at + 1], held[at + 2]);
    this.fault("");
    if (Math.hypot(x - target[0], y - target[1]) * this.view.scale < NEAR) return undefined;
    const given = new Map(m.given.map((g) => [g.reference, g]));
    const moves = m.picture.joints[joint].moves.map((reference) => given.get(reference)!);
    const free = moves
      .filter(({ name }) => !(this.state.locks ?? []).includes(name))
      .map(({ reference }) => reference);
    if (free.length === 0) {
      this.fault(capital(`${moves.map(called).join(" and ")} ${moves.length > 1 ? "are" : "is"} locked`));
      return undefined;
    }
    // the configuration that is drawn is the start of what is dragged
    const start = m.freedoms.flatMap((f): [number, number][] => [
      [f.initial[0], held[outputPlace(m, f.coordinate)]],
      [f.initial[1], held[outputPlace(m, f.rate)]],
    ]);
    this.core.give([...allGiven(m, this.state.values), ...start]);
    const before = free.map((reference) => this.core.given(reference));
    const { values: row, sentence } = this.core.drag(joint, free, this.view.matrix.slice(0, 6), target);
    this.fault(capital(sentence));
    if (free.every((reference, n) => this.core.given(reference) === before[n])) return undefined;
    this.held = row;
    const initial = new Set(start.map(([reference]) => reference));
    const pulled = free.every((reference) => initial.has(reference));
    this.pulled ||= pulled;
    const moved = pulled ? [...initial] : free.filter((reference) => !initial.has(reference));
    const named = (all: [number, number][]): Values =>
      Object.fromEntries(all.map(([reference, value]) => [given.get(reference)!.name, value]));
    const changed = named(moved.map((reference) => [reference, this.core.given(reference)]));
    const state: State = { ...this.state, values: { ...this.state.values, ...changed } };
    if (pulled) return { ...state, source: "run" };
    // where the links cannot be joined at the start any more, a run begins at what is drawn
    if (!this.begin(this.core, m, state).sentence) return state;
    return { ...state, values: { ...state.values, ...named(start) } };
  }

  /** Show a state that comes from elsewhere, as a step that can be undone. */
  private async take(state: State): Promise<void> {
    if (await this.open(state)) return;
    this.history.keep(state);
    this.name();
  }

  /** Show another state; for scripts too. */
  async restore(state: State | undefined): Promise<void> {
    if (state) await this.open(state);
  }

  /** The other assembly: the first sign that says how the links are joined. */
  private assemble(): void {
    const sign = this.mechanism.given.find((g) => g.choices && "-1" in g.choices);
    if (sign) this.change({ [sign.name]: -this.value(sign) }, true);
    else this.fault("These links can be joined in one way only");
  }

  private fault(sentence: string): void {
    const place = by<HTMLElement>("fault");
    if (place.textContent !== sentence) place.textContent = sentence;
  }

  private name(): void {
    this.controls.name(this.state);
    by<HTMLButtonElement>("undo").disabled = !this.history.canUndo;
    by<HTMLButtonElement>("redo").disabled = !this.history.canRedo;
  }

  // The page

  private play(moving: boolean): void {
    this.playback.moving = moving;
    this.controls.show(this.playback);
  }

  private theme(dark: boolean): void {
    document.documentElement.dataset.theme = dark ? "dark" : "light";
    const { answer } = this.playback;
    if (!answer) return;
    this.charts.show(this.mechanism, answer.source);
    this.charts.data(answer.rows, answer.source);
  }

  private wire(): void {
    this.theme(matchMedia("(prefers-color-scheme: dark)").matches);
    this.picture.onGrab = () => this.hold();
    this.picture.onDrag = (joint, target, done) => this.drag(joint, target, done);
    this.view.onChange = () => {
      this.backdrop.draw();
      this.python.draw();
      const { answer } = this.playback;
      if (!answer) return;
      this.picture.drawPaths(answer.rows.values);
      this.seek(this.playback.row);
    };
    new ResizeObserver(() => this.refit()).observe(by("picture"));
    addEventListener("hashchange", () => {
      try {
        const state = readState(location.href, this.tables);
        if (state) void this.take(state);
      } catch (error) {
        this.fault((error as Error).message);
      }
    });
    by("panel").addEventListener("toggle", () => this.seek(this.playback.row), true);
  }

  private refit(): void {
    if (!this.playback.answer) return;
    this.picture.fit(this.playback.answer.rows.values);
    this.view.onChange();
  }

  private look(name: string): void {
    if (name === "larger") this.view.larger();
    else if (name === "smaller") this.view.smaller();
    else {
      this.view.look(name);
      this.refit();
    }
  }

  /** Save what is shown, in one of the forms of the list. */
  private async save(form: string): Promise<void> {
    const { mechanism, state, picture: drawing } = this;
    const { rows, orbit, source } = this.playback.answer ?? {};
    await saveAs(form, { mechanism, state, duration: this.duration(), rows, source, orbit, drawing });
    if (form !== "link") return;
    history.replaceState(null, "", pageAddress({ ...state, view: this.view.kept }));
    this.fault("");
    by("words").textContent = "The address of this page now holds its state: copy it.";
  }

  /** Go to a row, and on from there. */
  go(row: number): void {
    if (!this.playback.answer) return;
    this.seek(row);
    this.playback.time = this.playback.timeOf(this.playback.row);
  }

  private pause(row: number): void {
    this.play(false);
    this.go(row);
  }

  /** For scripts: what is shown, and which row of it is drawn. */
  shown(): { rows: Rows; row: number; source: Source; answer: Answer } | undefined {
    const { answer, row } = this.playback;
    return answer && { ...answer, row, answer };
  }
}

declare global {
  interface Window {
    studio: Studio;
  }
}

window.studio = new Studio();
void window.studio.start();
