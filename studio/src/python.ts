/** What the page does with Python behind it: each part asks for a job, and shows what came of it. */

import uPlot from "uplot";
import { bytesOf, Core, type Rows } from "./core";
import { save } from "./exports";
import { type Answer, type Job, type Request, Server } from "./server";
import { resampled, Sketch } from "./sketch";
import { type Given, givenOf, jointAt, type Mechanism, outputAt, rowLength, type State } from "./tables";
import type { Point, View } from "./view";
import { digits } from "./words";

export interface Desk {
  /** With the duration of a run. */
  state(): State;
  /** Show a state, as a step that can be undone. */
  take(state: State): void;
  rows(): Rows | undefined;
}

const RPM = 30 / Math.PI;
/** Rows of a run of the FMU, and points of a path that is taken from the mechanism. */
const ROWS = 720;
const POINTS = 72;
const FROM_A_FILE =
  "Linkages for a path that is drawn, the slider's motion, tuning away a resonance, runs of the FMU and its export: " +
  "the command linkwork studio opens this page with them. This one was opened as a file, which has no Python behind it.";

type Child = Node | string;

function make<K extends keyof HTMLElementTagNameMap>(
  kind: K,
  properties: Partial<HTMLElementTagNameMap[K]> = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const made = Object.assign(document.createElement(kind), properties);
  made.append(...children);
  return made;
}

const line = (...children: Child[]): HTMLElement => make("div", { className: "line" }, ...children);

function button(text: string, action: () => void): HTMLButtonElement {
  const made = make("button", { textContent: text, type: "button" });
  made.addEventListener("click", action);
  return made;
}

function number(label: string, unit: string, value: number | ""): [HTMLLabelElement, HTMLInputElement] {
  const field = make("input", { type: "number", step: "any", min: "0", value: String(value) });
  return [make("label", {}, `${label} `, field, unit ? ` ${unit}` : ""), field];
}

function tick(label: string, checked: boolean): [HTMLLabelElement, HTMLInputElement] {
  const field = make("input", { type: "checkbox", checked });
  return [make("label", {}, field, ` ${label}`), field];
}

/** A part that opens; only one is open at a time. */
function part(title: string, ...children: Child[]): HTMLDetailsElement {
  const made = make("details", {}, make("summary", { textContent: title }), ...children);
  made.setAttribute("name", "python");
  return made;
}

export class WithPython {
  private readonly server = Server.here();
  private readonly sketch: Sketch;
  private mechanism!: Mechanism;
  private parts = make("div");
  private readonly bar = make("progress", { max: 1 });
  private readonly doing = make("span");
  private readonly running = line(
    this.bar,
    this.doing,
    button("Cancel", () => void this.server?.cancel()),
  );
  private readonly fault = make("p", { className: "fault" });
  private readonly answer = make("div");
  private begins: HTMLButtonElement[] = [];

  constructor(
    private readonly place: HTMLElement,
    view: View,
    private readonly desk: Desk,
  ) {
    this.sketch = new Sketch(view, document.getElementById("picture") as unknown as SVGSVGElement);
    this.bar.setAttribute("aria-label", "Progress of the job");
    this.doing.setAttribute("role", "status");
    this.fault.setAttribute("role", "alert");
    this.answer.setAttribute("aria-live", "polite");
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
    if (!this.server) return;
    this.begins = [];
    this.sketch.show();
    this.parts.replaceChildren(
      ...(mechanism.picture.planar ? [this.path()] : []),
      this.tuning(state),
      part(
        "The FMU",
        line(this.begin("Run it beside the page", "run", () => ({ rows: ROWS }))),
        line(
          this.begin("Save it with these values", "export", () => ({ kind: "native" })),
          this.begin("the same for FMI 3.0", "export", () => ({ kind: "native-fmi3" })),
        ),
      ),
    );
  }

  /** What is drawn over the mechanism, after a change of the view. */
  draw(): void {
    this.sketch.draw();
  }

  // The parts

  private path(): HTMLElement {
    const { sketch } = this;
    const svg = document.getElementById("picture")!;
    const draw = button("Draw a path on the picture", () => sketch.listen(!sketch.listening));
    draw.setAttribute("aria-pressed", "false");
    const [closed, isClosed] = tick("closed", true);
    const points = make("textarea", { rows: 6, spellcheck: false });
    points.placeholder = "x and y of a point in mm, a line each";
    points.setAttribute("aria-label", "Points of the path: x and y in mm, a line each");
    sketch.onDrawing = (drawing) => {
      draw.setAttribute("aria-pressed", String(drawing));
      svg.classList.toggle("drawing", drawing);
    };
    sketch.onChange = () => {
      isClosed.checked = sketch.closed;
      points.value = sketch.points.map((p) => p.map((v) => digits(1e3 * v, 5)).join(" ")).join("\n");
    };
    isClosed.addEventListener("change", () => sketch.put(sketch.points, isClosed.checked));
    points.addEventListener("change", () => {
      const rows = points.value.split("\n").map((row) =>
        row
          .trim()
          .split(/[\s,;]+/)
          .map(Number),
      );
      const read = rows.filter((row) => row.length === 2 && row.every(Number.isFinite));
      sketch.put(
        read.map(([x, y]): Point => [x / 1e3, y / 1e3]),
        isClosed.checked,
      );
    });
    const [angle, leastAngle] = number("transmission angle at least", "deg", 40);
    const [longest, longestLink] = number("longest link", "mm", "");
    const [harmonics, count] = number("harmonics", "", 2);
    const [stroke, greatest] = number("stroke at most", "mm", "");
    const target = (): object => ({ points: sketch.points, closed: sketch.closed });
    const length = (name: string, field: HTMLInputElement): object =>
      field.value === "" ? {} : { [name]: Number(field.value) / 1e3 };
    const linkages = this.begin("Find linkages", "linkages", () => ({
      ...target(),
      ...length("longest", longestLink),
      least_transmission: (Number(leastAngle.value) * Math.PI) / 180,
    }));
    const slider = this.begin("Move the slider for it", "slider", () => ({
      ...target(),
      ...length("stroke", greatest),
      harmonics: Number(count.value),
    }));
    const moves = this.mechanism.given.some((given) => given.name === "initial.slider_position");
    return part(
      "A path",
      line(
        draw,
        button("Take the path of the mechanism", () => this.taken()),
        closed,
      ),
      make("details", {}, make("summary", { textContent: "Its points" }), points),
      line(linkages, angle, longest),
      ...(moves ? [line(slider, harmonics, stroke)] : []),
    );
  }

  /** The path of the mechanism's own point, to be changed by its points. */
  private taken(): void {
    const rows = this.desk.rows();
    const joint = this.mechanism.picture.paths[0];
    if (!rows || rows.count < 4 || joint === undefined) return;
    const length = rowLength(this.mechanism);
    const { crank, freedoms } = this.mechanism;
    const turned = (n: number): number =>
      crank < 0 ? 0 : rows.values[n * length + outputAt(this.mechanism, freedoms[crank].coordinate)];
    const all: Point[] = [];
    // a turn of the crank, without its end
    for (let n = 0; n < rows.count; n++) {
      if (crank >= 0 && Math.abs(turned(n) - turned(0)) >= freedoms[crank].period * (1 - 1e-6)) break;
      const at = n * length + jointAt(this.mechanism, joint);
      all.push([rows.values[at], rows.values[at + 1]]);
    }
    this.sketch.put(resampled(all, true, POINTS), true);
  }

  private tuning(state: State): HTMLElement {
    const value = (given: Given): number => state.values[given.name] ?? given.start;
    const speed = this.mechanism.given.find((given) => given.unit === "rpm" && given.argument !== undefined);
    const now = speed ? Math.abs(value(speed)) * RPM : 0;
    const [from, low] = number("speeds from", "rpm", Number((0.95 * now).toFixed(1)) || "");
    const [to, high] = number("to", "rpm", Number((1.05 * now).toFixed(1)) || "");
    const [share, percent] = number("each by at most", "%", 10);
    const wishes = [tick("no resonance", true), tick("no jump", false), tick("no unstable motion", false)];
    const sections = ["Dimensions", "Spring, damper, friction", "Masses"];
    const may = this.mechanism.given
      .filter((given) => sections.includes(given.section) && !given.choices)
      .map((given) => ({ given, box: tick(given.name, given.name.endsWith("stiffness")) }));
    return part(
      "A range of speeds without resonance",
      line(from, to, ...wishes.map(([label]) => label)),
      make(
        "fieldset",
        {},
        make("legend", { textContent: "What may change" }),
        ...may.map(({ box }) => box[0]),
      ),
      line(
        this.begin("Change least", "tune", () => ({
          speeds: [Number(low.value) / RPM, Number(high.value) / RPM],
          share: Number(percent.value) / 100,
          change: may.filter(({ box }) => box[1].checked).map(({ given }) => given.name),
          no_resonance: wishes[0][1].checked,
          no_jump: wishes[1][1].checked,
          no_unstable: wishes[2][1].checked,
        })),
        share,
      ),
    );
  }

  // Jobs

  /** A button that begins a job. */
  private begin(text: string, kind: string, wanted: () => object): HTMLButtonElement {
    const made = button(text, () => void this.work(kind, wanted()));
    this.begins.push(made);
    return made;
  }

  private async work(kind: string, wanted: object): Promise<void> {
    const { mechanism, title, values, duration } = this.desk.state();
    const request: Request = { mechanism, title, values, duration };
    this.fault.textContent = "";
    this.answer.replaceChildren();
    this.busy({ state: "running", what: "begins" });
    const begun = await this.server!.give(kind, request, wanted);
    await this.end(begun.state === "running" ? await this.followed() : begun, request);
  }

  /** Go on with the job that was being done when the page was opened anew. */
  private async resume(): Promise<void> {
    const job = await this.server!.look();
    if (job.state === "running") await this.end(await this.followed(), this.desk.state());
  }

  private followed(): Promise<Job> {
    return this.server!.follow((job) => this.busy(job));
  }

  private busy(job: Job): void {
    this.running.hidden = false;
    for (const one of this.begins) one.disabled = true;
    if (job.share) this.bar.value = job.share;
    else this.bar.removeAttribute("value");
    const share = job.share ? ` ${Math.floor(100 * job.share)} %` : "";
    const text = `${job.what ?? ""}${share}`;
    if (this.doing.textContent !== text) this.doing.textContent = text;
  }

  private async end(job: Job, request: Request): Promise<void> {
    this.running.hidden = true;
    for (const one of this.begins) one.disabled = false;
    this.fault.textContent = job.sentence ?? (job.state === "cancelled" ? "Cancelled." : "");
    if (job.state !== "done" || !job.answer) return;
    const answer = JSON.parse(job.answer) as Answer;
    this.answer.replaceChildren(make("p", { textContent: answer.words }));
    this.table(answer, job.kind ?? "");
    for (const { title, unit, x, y } of answer.charts ?? [])
      this.chart(`${title} [${unit}]`, x, [{ label: title, y }]);
    for (const { name, base64 } of answer.files ?? []) this.file(name, base64);
    if (answer.outputs) await this.beside(answer, request);
    if (job.kind === "export" && answer.files) this.answer.querySelector("button")?.click();
  }

  // What came of them

  private table({ table, states, curves, closed }: Answer, kind: string): void {
    if (!table) return;
    const made = make("table");
    const head = made.createTHead().insertRow();
    const each = curves !== undefined;
    for (const text of each ? [...table.headings, ""] : table.headings)
      head.append(make("th", { textContent: text, scope: "col" }));
    const body = made.createTBody();
    const target = this.sketch.points;
    table.rows.forEach((cells, n) => {
      const row = body.insertRow();
      for (const text of cells) row.insertCell().textContent = text;
      if (!each) return;
      const shown = (): void => {
        if (states) this.desk.take(states[n]);
        // of a linkage the path that was wanted, in its own frame
        if (states) this.sketch.put(curves[n], closed ?? true);
        else this.sketch.put(target, closed ?? true, curves[n]);
      };
      const pick = button(states ? "Show" : "Draw", shown);
      pick.setAttribute("aria-label", `${pick.textContent}: ${cells[0]}`);
      row.insertCell().append(pick);
    });
    this.answer.append(make("div", { className: "wide" }, made));
    if (states && !each) this.answer.append(line(button("Take it over", () => this.desk.take(states[0]))));
    if (kind === "slider" && curves) this.sketch.put(target, closed ?? true, curves[curves.length - 1]);
  }

  private file(name: string, base64: string): void {
    const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
    this.answer.append(line(button(`Save ${name}`, () => save(name, new Blob([bytes])))));
  }

  /** The FMU's run over the page's own, and where they differ most. */
  private async beside(answer: Answer, request: Request): Promise<void> {
    const m = this.mechanism;
    const core = await Core.make(m, await bytesOf(m));
    core.give(givenOf(m, request.values));
    const own = core.run((request.duration ?? 1) / ROWS, ROWS);
    const count = Math.min(own.count, answer.time!.length);
    const length = rowLength(m);
    const curves = m.outputs.map((output, n) => {
      const page = Array.from({ length: count }, (_, row) => own.values[row * length + outputAt(m, n)]);
      const fmu = answer.outputs![output.name].slice(0, count);
      return { output, page, fmu, largest: Math.max(...page.map(Math.abs)) };
    });
    const found = curves.map((curve) => {
      const like = curves.filter(({ output }) => output.unit === curve.output.unit).map((one) => one.largest);
      const scale = Math.max(curve.largest, 1e-3 * Math.max(...like));
      const apart = curve.page.map((value, row) => Math.abs(value - curve.fmu[row]));
      const most = Math.max(
        ...apart.map((d) => (curve.output.unit === "deg" ? Math.min(d, Math.abs(2 * Math.PI - d)) : d)),
      );
      return { ...curve, most, relative: scale > 0 ? most / scale : 0 };
    });
    const worst = found.reduce((one, other) => (other.relative > one.relative ? other : one));
    const said = make("p", {
      textContent:
        `The runs have ${count} instants. They differ by at most ${worst.relative.toExponential(1)} of the largest value, in ` +
        `${worst.output.name}: by ${worst.most.toExponential(1)} in SI.`,
    });
    said.dataset.relative = String(worst.relative);
    const choice = make("select");
    for (const { output } of found) choice.add(new Option(output.name));
    choice.value = worst.output.name;
    const chart = make("div");
    const drawn = (): void => {
      const { output, page, fmu } = found.find((one) => one.output.name === choice.value)!;
      const shown = (values: number[]): number[] => values.map((value) => value * output.factor);
      chart.replaceChildren();
      const series = [
        { label: "page", y: shown(page) },
        { label: "FMU", y: shown(fmu) },
      ];
      this.chart(`${output.name} [${output.unit}]`, answer.time!.slice(0, count), series, chart);
    };
    choice.addEventListener("change", drawn);
    this.answer.append(said, make("label", {}, "Output ", choice), chart);
    drawn();
  }

  private chart(
    title: string,
    x: number[],
    curves: { label: string; y: number[] }[],
    place: HTMLElement = this.answer,
  ): void {
    const colours = getComputedStyle(document.body);
    const stroke = colours.getPropertyValue("--text");
    const grid = { stroke: colours.getPropertyValue("--line"), width: 1 };
    const looks = [
      { stroke: colours.getPropertyValue("--accent"), width: 4 },
      { stroke: colours.getPropertyValue("--trace"), width: 1.5, dash: [7, 4] },
    ];
    const box = make("figure", {}, make("figcaption", { textContent: title }));
    place.append(box);
    new uPlot(
      {
        width: Math.max(220, this.place.clientWidth - 40),
        height: 150,
        legend: { show: curves.length > 1, live: false },
        scales: { x: { time: false } },
        axes: [
          { stroke, grid, ticks: grid, size: 28 },
          { stroke, grid, ticks: grid, size: 58 },
        ],
        series: [{}, ...curves.map(({ label }, n) => ({ label, points: { show: false }, ...looks[n] }))],
      },
      [x, ...curves.map(({ y }) => y)],
      box,
    );
  }
}
