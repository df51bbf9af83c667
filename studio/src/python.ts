/** What the page does with Python behind it: each part asks for a job, and shows what came of it. */

import { showAnswer, answerTable } from "./answer";
import { showComparison, STEPS } from "./comparison";
import type { Rows } from "./motions";
import { button, line, make, part, tick, Wrong } from "./elements";
import { pathPart } from "./path";
import { type Answer, type Job, type Request, Server } from "./server";
import { Sketch } from "./sketch";
import type { Mechanism, State } from "./tables";
import { tuningPart } from "./tuning";
import type { View } from "./view";
import { plainly } from "./words";

export interface Desk {
  /** With the duration of a run. */
  state(): State;
  /** Show a state, as a step that can be undone. */
  take(state: State): Promise<void>;
  rows(): Rows | undefined;
}

const FROM_A_FILE =
  "Linkages for a path that is drawn, the slider's motion, tuning away a resonance, runs of the FMU and its export: " +
  "the command linkwork studio opens this page with them. This one was opened as a file, which has no Python behind it.";

export class WithPython {
  private readonly server = Server.here();
  private readonly sketch: Sketch;
  private mechanism!: Mechanism;
  private parts = make("div");
  private readonly bar = make("progress", { max: 1, "aria-label": "Progress of the job" });
  private readonly doing = make("span", { role: "status" });
  private readonly running = line(
    this.bar,
    this.doing,
    button("Cancel", () => void this.server?.cancel()),
  );
  private readonly fault = make("p", { className: "fault", role: "alert" });
  private readonly answer = make("div", { "aria-live": "polite" });
  private begins: HTMLButtonElement[] = [];
  private wrong: HTMLElement | undefined;
  private busyWith = false;

  constructor(
    place: HTMLElement,
    view: View,
    private readonly desk: Desk,
  ) {
    this.sketch = new Sketch(view, document.getElementById("picture") as unknown as SVGSVGElement);
    this.running.hidden = true;
    place.append(make("h2", { textContent: "With Python" }));
    if (this.server) {
      place.append(this.parts, this.running, this.fault, this.answer);
      void this.resume();
    } else place.append(make("p", { textContent: FROM_A_FILE }));
  }

  /** The parts for another mechanism. */
  show(mechanism: Mechanism, state: State): void {
    this.mechanism = mechanism;
    const { server, sketch } = this;
    if (!server) return;
    this.begins = [];
    sketch.show();
    const begin = this.begin.bind(this);
    const { kinds } = server;
    const rows = (): Rows | undefined => this.desk.rows();
    const wrong = (found: Wrong | undefined): void => this.say(found, false);
    this.parts.replaceChildren(
      ...(mechanism.picture.planar ? [pathPart({ mechanism, sketch, kinds, rows, begin, wrong })] : []),
      tuningPart({ mechanism, state: () => this.desk.state(), begin }, state),
      this.fmu(),
    );
  }

  /** What is drawn over the mechanism, after a change of the view. */
  draw(): void {
    this.sketch.draw();
  }

  private fmu(): HTMLElement {
    const [everywhere, isEverywhere] = tick("for all platforms", false);
    const wanted = (kind: string) => (): object => ({ kind, everywhere: isEverywhere.checked });
    return part(
      "The FMU",
      line(this.begin("Run it beside the page", "run", () => ({ rows: STEPS }))),
      line(
        this.begin("Save it with these values", "export", wanted("native")),
        this.begin("the same for FMI 3.0", "export", wanted("native-fmi3")),
        everywhere,
      ),
    );
  }

  // Jobs

  /** A button that begins a job. */
  private begin(text: string, kind: string, wanted: () => object): HTMLButtonElement {
    const made = button(text, () => {
      this.say(undefined);
      try {
        void this.work(kind, wanted());
      } catch (error) {
        this.say(error as Wrong);
      }
    });
    made.disabled = this.busyWith;
    this.begins.push(made);
    return made;
  }

  /** Say what is wrong with what a form has, and go there. */
  private say(found: Wrong | undefined, go = true): void {
    this.fault.textContent = found?.message ?? "";
    this.wrong?.removeAttribute("aria-invalid");
    this.wrong = found?.field;
    if (this.wrong?.matches("input, textarea")) this.wrong.setAttribute("aria-invalid", "true");
    if (go) this.wrong?.focus();
  }

  private async work(kind: string, wanted: object): Promise<void> {
    const { mechanism, title, values, duration } = this.desk.state();
    const request: Request = { mechanism, title, values, duration };
    this.answer.replaceChildren();
    this.busy({ state: "running", what: "starting" });
    const begun = await this.server!.give(kind, request, wanted);
    if (begun.state === "running") await this.follow(begun, true);
    else {
      this.end(begun);
      // it may be another tab's that is being done: here, too, it can be cancelled
      await this.resume();
    }
  }

  /** Go on with a job that is being done: of another tab, or from before the page was opened anew. */
  private async resume(): Promise<void> {
    const job = await this.server!.look();
    if (job.state === "running") await this.follow(job, false);
  }

  private async follow(begun: Job, own: boolean): Promise<void> {
    const job = await this.server!.follow(begun, (now) => this.busy(now));
    this.end(job);
    if (job.state !== "done" || !job.answer) return;
    await this.came(JSON.parse(job.answer) as Answer, job.kind ?? "");
    if (own && job.kind === "export") this.answer.querySelector("button")?.click();
  }

  private busy(job: Job): void {
    this.busyWith = true;
    this.running.hidden = false;
    for (const one of this.begins) one.disabled = true;
    if (job.share) this.bar.value = job.share;
    else this.bar.removeAttribute("value");
    const share = job.share ? ` ${Math.floor(100 * job.share)} %` : "";
    const text = `${job.what ?? ""}${share}`;
    if (this.doing.textContent !== text) this.doing.textContent = text;
  }

  private end(job: Job): void {
    this.busyWith = false;
    this.running.hidden = true;
    for (const one of this.begins) one.disabled = false;
    this.fault.textContent = job.state === "cancelled" ? "Cancelled." : plainly(job.sentence ?? "");
  }

  /** Show what came of a job. */
  private async came(answer: Answer, kind: string): Promise<void> {
    const { states, curves, table } = answer;
    const wanted = this.sketch.points;
    const closed = answer.closed ?? true;
    const show = async (n: number): Promise<void> => {
      const state = states?.[n];
      if (state) {
        await this.desk.take(state);
        // the path that was wanted, in the linkage's own frame
        if (this.mechanism.picture.planar) this.sketch.put(curves![n], closed);
      } else this.sketch.put(wanted, closed, curves![n]);
      document.getElementById("picture")!.scrollIntoView({ block: "nearest" });
    };
    const last = (n: number): Node[] => {
      if (states && !states[n]) return [];
      const pick = button(states ? "Show" : "Draw", () => void show(n));
      pick.setAttribute("aria-label", `${pick.textContent}: ${table!.rows[n][0]}`);
      return [pick];
    };
    showAnswer(this.answer, answer, table && answerTable(answer, wanted, curves && last));
    if (table && states?.[0] && !curves)
      this.answer.append(line(button("Take it over", () => void this.desk.take(states[0]!))));
    if (kind === "slider" && curves) this.sketch.put(wanted, closed, curves[curves.length - 1]);
    const of = answer.outputs && states?.[0]?.mechanism;
    if (of === this.mechanism.name) await showComparison(this.answer, this.mechanism, answer);
  }
}
