/** A run of the FMU over the page's own. */

import { drawCurves } from "./answer";
import { moduleBytes, Core } from "./core";
import { make } from "./elements";
import type { Answer } from "./server";
import { allGiven, type Mechanism, type Output, outputPlace, rowLength } from "./tables";
import { called, digits, shown } from "./words";

/** Steps of a run of the FMU. */
export const STEPS = 720;

interface Pair {
  output: Output;
  page: number[];
  fmu: number[];
  /** The largest difference, and as a share of the largest value. */
  most: number;
  relative: number;
}

/** Where the runs differ most is said; what is drawn is chosen, first how the mechanism moves. */
export async function showComparison(place: HTMLElement, m: Mechanism, answer: Answer): Promise<void> {
  const pairs = await loadPairs(m, answer);
  const worst = pairs.reduce((one, other) => (other.relative > one.relative ? other : one));
  const said = make("p", {
    textContent:
      `Over ${pairs[0].page.length} instants the two differ most in ${called(worst.output)}: by ` +
      `${shown(worst.most, worst.output, 2)}, ${digits(worst.relative, 2)} of the largest value.`,
  });
  said.dataset.relative = String(worst.relative);
  const choice = make("select");
  for (const { output } of pairs) choice.add(new Option(called(output), output.name));
  // what swings farthest, or how fast the crank turns
  const range = (n: number): number => Math.max(...pairs[n].page) - Math.min(...pairs[n].page);
  const [first] = [...m.moving].sort((one, other) => range(other) - range(one));
  choice.value = m.outputs[first ?? m.freedoms[Math.max(0, m.crank)].rate].name;
  const chart = make("div");
  const drawn = (): void => {
    const { output, page, fmu } = pairs.find((one) => one.output.name === choice.value)!;
    const curve = (label: string, values: number[]): { label: string; y: number[] } => ({
      label,
      y: values.map((value) => value * output.factor),
    });
    const title = `${called(output)}${output.unit && ` [${output.unit}]`}`;
    const time = answer.time!.slice(0, page.length);
    chart.replaceChildren();
    drawCurves(chart, title, "time [s]", time, [curve("page", page), curve("FMU", fmu)]);
  };
  choice.addEventListener("change", drawn);
  place.append(said, make("label", {}, "Output ", choice), chart);
  drawn();
}

async function loadPairs(m: Mechanism, answer: Answer): Promise<Pair[]> {
  const { values, duration } = answer.states![0]!;
  const core = await Core.make(m, await moduleBytes(m));
  core.give(allGiven(m, values));
  const own = core.run((duration ?? 1) / STEPS, STEPS);
  const count = Math.min(own.count, answer.time!.length);
  const length = rowLength(m);
  const curves = m.outputs.map((output, n) => {
    const page = Array.from({ length: count }, (_, row) => own.values[row * length + outputPlace(m, n)]);
    const fmu = answer.outputs![output.name].slice(0, count);
    return { output, page, fmu, largest: Math.max(...page.map(Math.abs)) };
  });
  return curves.map(({ output, page, fmu, largest }) => {
    const like = curves.filter((one) => one.output.unit === output.unit).map((one) => one.largest);
    // what is nearly nothing is held against what there is of its unit
    const scale = Math.max(largest, 1e-3 * Math.max(...like));
    const apart = page.map((value, row) => Math.abs(value - fmu[row]));
    const most = Math.max(
      ...apart.map((d) => (output.unit === "deg" ? Math.min(d, Math.abs(2 * Math.PI - d)) : d)),
    );
    return { output, page, fmu, most, relative: scale > 0 ? most / scale : 0 };
  });
}
