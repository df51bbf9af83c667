/** Curves over a turn of the crank, or over time. */

import uPlot from "uplot";
import uplotStyle from "uplot/dist/uPlot.min.css";
import { make } from "./elements";
import type { Rows } from "./motions";
import {
  type Chart as Table,
  type Curve,
  type Mechanism,
  outputPlace,
  rowLength,
  type Source,
} from "./tables";
import { called, digits, roundingSizes } from "./words";

/** Colours alone do not tell the curves apart; of each there is a colour `--curve` with its number. */
const DASHES: number[][] = [[], [7, 3], [2, 3], [9, 3, 2, 3], [4, 2], [12, 4]];
const HEIGHT = 170;
const FONT = "12px system-ui, sans-serif";
/** Steps between the marks of an axis in deg. */
const TURNS = [1, 2, 5, 10, 15, 30, 45, 90, 180, 360];

const colour = (name: string): string => getComputedStyle(document.body).getPropertyValue(`--${name}`);

/** How a curve is drawn, by its number. */
export interface Look {
  label: string;
  stroke: string;
  dash: number[];
  width: number;
}

export function look(label: string, number: number, width = 1.5): Look {
  const n = number % DASHES.length;
  return { label, stroke: colour(`curve${n}`), dash: DASHES[n], width };
}

/** A piece of the curve itself, as the background of its mark in a legend. */
function sample({ stroke, dash, width }: Look): string {
  const line = `<path d="M0 4h30" stroke="${stroke}" stroke-width="${width + 0.5}" stroke-dasharray="${dash.join(" ")}"/>`;
  const drawing = `<svg xmlns="http://www.w3.org/2000/svg" width="30" height="8">${line}</svg>`;
  return `url("data:image/svg+xml,${encodeURIComponent(drawing)}") no-repeat`;
}

/** Curves over an axis with a name and a unit, in the colours of the page; without data yet. */
export function makePlot(
  place: HTMLElement,
  axis: string,
  looks: Look[],
  options: Partial<uPlot.Options>,
): uPlot {
  // a click on a name in the legend shows and hides its curve, which uPlot hears of
  const title = "Show or hide this curve";
  const switches = looks.map(({ label }) =>
    make("button", { textContent: label, title, "aria-pressed": "true" }),
  );
  const pressed = (plot: uPlot, n: number | null): void =>
    void (n && switches[n - 1].setAttribute("aria-pressed", String(plot.series[n].show)));
  const stroke = colour("text");
  const grid = { stroke: colour("line"), width: 1 };
  const both = { stroke, grid, ticks: grid, font: FONT };
  const label = { label: axis, labelFont: FONT, labelSize: 16, size: 32 };
  return new uPlot(
    {
      width: 300,
      height: HEIGHT,
      legend: {
        show: looks.length > 1,
        live: false,
        markers: { width: 0, fill: (_, series) => sample(looks[series - 1]) },
      },
      cursor: { drag: { x: true, y: false } },
      scales: { x: { time: false } },
      axes: [
        {
          ...both,
          ...label,
          ...(axis.endsWith("[deg]") && { incrs: TURNS }),
          values: (_, all) => all.map((mark) => digits(mark, 6)),
        },
        // room for two marks at least, written as all numbers of the page are
        { ...both, size: 64, space: 20, values: (_, all) => all.map((mark) => digits(mark, 6)) },
      ],
      series: [
        { label: axis },
        ...looks.map((one, n) => ({ ...one, label: switches[n], pxAlign: 0, points: { show: false } })),
      ],
      ...options,
      hooks: { ...options.hooks, setSeries: [pressed] },
    },
    [[], ...looks.map(() => [])],
    place,
  );
}

interface Chart {
  plot: uPlot;
  line: HTMLElement;
  curves: Curve[];
  unit: string;
  factor: number;
}

export class Charts {
  private charts: Chart[] = [];
  private axis: number[] = [];
  private row = 0;
  private kind: Source | "" = "";
  private mechanism!: Mechanism;
  private wanted: (chart: Table) => boolean = () => true;
  private readonly widths = new ResizeObserver(() => {
    for (const { plot } of this.charts)
      plot.setSize({ width: Math.max(220, plot.root.parentElement!.clientWidth - 16), height: HEIGHT });
  });

  constructor(private readonly place: HTMLElement) {
    document.head.append(make("style", { textContent: uplotStyle }));
  }

  /** Make those charts of a mechanism anew that are wanted; colours of text and grid are those of the page. */
  show(mechanism: Mechanism, source: Source, wanted = this.wanted): void {
    this.mechanism = mechanism;
    this.wanted = wanted;
    this.kind = source;
    for (const { plot } of this.charts) plot.destroy();
    this.widths.disconnect();
    this.place.replaceChildren();
    const axis = source === "steady" ? "crank angle [deg]" : "time [s]";
    this.charts = mechanism.charts.filter(wanted).map(({ title, unit, factor, curves }) => {
      const label = `${title} in ${unit}: ${curves.map(called).join(", ")}`;
      const caption = make("figcaption", { textContent: `${title} [${unit}]` });
      const box = make("figure", { "aria-label": label }, caption);
      this.place.append(box);
      const looks = curves.map((curve, n) => look(called(curve), n));
      // its scale is known when it is drawn
      const hooks = { draw: [() => this.mark(this.row)] };
      const plot = makePlot(box, axis, looks, { hooks });
      const line = make("div", { className: "now" });
      plot.over.append(line);
      this.widths.observe(box);
      return { plot, line, curves, unit, factor };
    });
  }

  /** Put the curves of other rows; `axis` in deg or s. */
  data(rows: Rows, source: Source): void {
    if (source !== this.kind) this.show(this.mechanism, source);
    const m = this.mechanism;
    const length = rowLength(m);
    const crank = source === "steady" && m.crank >= 0 ? outputPlace(m, m.freedoms[m.crank].coordinate) : -1;
    const value = (row: number, of: number[]): number => {
      const parts = of.map((output) => rows.values[row * length + outputPlace(m, output)]);
      return parts.length === 1 ? parts[0] : Math.hypot(...parts);
    };
    const numbers = Array.from({ length: rows.count }, (_, row) => row);
    this.axis = numbers.map((row) =>
      crank < 0 ? rows.values[row * length] : (rows.values[row * length + crank] * 180) / Math.PI,
    );
    const roundings = roundingSizes(m, rows);
    for (const { plot, unit, factor, curves } of this.charts) {
      const rounding = roundings.get(unit) ?? 0;
      const seen = (found: number): number => (Math.abs(found) > rounding ? found * factor : 0);
      plot.setData([this.axis, ...curves.map(({ of }) => numbers.map((row) => seen(value(row, of))))]);
    }
  }

  /** Mark the instant that is drawn. */
  mark(row: number): void {
    this.row = row;
    for (const { plot, line } of this.charts)
      line.style.transform = `translateX(${plot.valToPos(this.axis[row] ?? 0, "x")}px)`;
  }
}
