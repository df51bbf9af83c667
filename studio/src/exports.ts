/** What is taken out of the page: files, and a link that holds the state. */

import type { Orbit, Rows } from "./motions";
import { dxfText } from "./dxf";
import type { Drawn } from "./picture";
import {
  type Given,
  type Mechanism,
  outputPlace,
  rowLength,
  type Source,
  type State,
  checkState,
  type Tables,
  givenValue,
} from "./tables";

/** A number as TOML and Python read it, with every digit. */
function written(number: number): string {
  const text = String(number);
  return /^-?\d+$/.test(text) ? `${text}.0` : text;
}

/** A value of the case in SI: an angle has its unit, as a number alone of four turns or more is refused. */
function quantity(given: Given, now: number): string {
  return given.unit === "deg" ? `"${now} rad"` : written(now);
}

/** The case as `linkwork run` reads it. */
export function caseText(m: Mechanism, state: State, duration: number): string {
  const which = m.described
    ? `linkage = ${JSON.stringify(`${m.name}.toml`)}  # the file that describes it`
    : `mechanism = ${JSON.stringify(m.name)}`;
  const lines = [which, `title = ${JSON.stringify(state.title)}`];
  const modes = m.given.filter((g) => g.arguments);
  const chosen = modes.map((mode) => mode.arguments![givenValue(mode, state.values)]);
  const inputs = m.given.filter((g) => g.argument !== undefined);
  const forced = new Set(inputs.filter((g) => g.kind === "force").map((g) => g.argument!));
  // a rate at the start is that of a freedom that a force drives
  const free = m.freedoms.map((freedom) => {
    const number = modes.findIndex((mode) => mode.reference === freedom.mode);
    return number < 0 || forced.has(chosen[number]);
  });
  const idle = new Set(m.freedoms.flatMap(({ initial }, n) => (free[n] ? [] : [initial[1]])));
  const motor = m.given.filter((g) => g.kind === "motor");
  const law = motor.map((g) => `${g.file!} = ${written(givenValue(g, state.values))}`).join(", ");
  // what acts: a motor beside the torque that is given
  const acting = (g: Given, now: number): string =>
    g.argument === motor[0]?.argument && givenValue(motor[0], state.values) !== 0
      ? `[${written(now)}, { kind = "induction-motor", ${law} }]`
      : written(now);
  for (const given of m.given) {
    if (given.kind === "motor") continue;
    const now = givenValue(given, state.values);
    if (given.arguments) {
      const flag = chosen[modes.indexOf(given)];
      if (!inputs.some((g) => g.argument === flag)) lines.push(`${given.name.split(".")[0]}.${flag} = true`);
    } else if (given.argument === undefined) {
      if (!idle.has(given.reference))
        lines.push(`${given.name} = ${given.choices ? String(now) : quantity(given, now)}`);
    } else if (chosen.includes(given.argument)) lines.push(`${given.file!} = ${acting(given, now)}`);
    else if (now !== 0 && !modes.some((mode) => mode.arguments!.includes(given.argument!)))
      lines.push(`${given.file!} = ${written(now)}`);
  }
  lines.push(`run.stop_time = ${written(duration)}`, `run.step = ${written(duration / 1440)}`);
  return `${lines.join("\n")}\n`;
}

/** Lines of Python that compute what the page shows: the run, and the periodic motion if there is one. */
export function pythonText(m: Mechanism, state: State, duration: number, orbit?: Orbit): string {
  const start = orbit?.found && orbit.size > 0 ? JSON.stringify(orbit.start) : undefined;
  return `import tomllib
from pathlib import Path

${start ? "from analysis.periodic import steady_drive, newton_orbit\n" : ""}from analysis.run import read_case, simulate

case = read_case(tomllib.loads(r"""
${caseText(m, state, duration)}"""), folder=Path())
run = simulate(case.parameters, case.inputs, initial=case.initial, stop_time=case.stop_time, step=case.step)
print(run)
${
  start
    ? `# of several motions that which the page shows, from its start
orbit = newton_orbit(case.parameters, steady_drive(case.parameters, case.inputs, case.initial), start=${start})
print(orbit, orbit.multipliers)
`
    : ""
}`;
}

const escaped = (text: string): string =>
  text.replace(/[&<>"]/g, (c) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" })[c]!);

/** All that is given, in the units of the FMU, as parameter values of SSP 1.0: `.ssv`, to be used beside the FMU. */
export function parameterText(m: Mechanism, state: State): string {
  // a motor of the page has no value reference: it is none of the FMU's
  const known = m.given.filter((given) => given.reference >= 0);
  const lines = known.map((given) => {
    const now = givenValue(given, state.values);
    const written = given.choices ? `<ssv:Integer value="${now}"/>` : `<ssv:Real value="${now}"/>`;
    return `    <ssv:Parameter name="${escaped(given.name)}">${written}</ssv:Parameter>`;
  });
  return `<?xml version="1.0" encoding="UTF-8"?>
<ssv:ParameterSet xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues" version="1.0" name="${escaped(state.title || m.name)}">
  <ssv:Parameters>
${lines.join("\n")}
  </ssv:Parameters>
</ssv:ParameterSet>
`;
}

/** Time and all outputs of the motion that is shown, in SI. */
export function tableText(m: Mechanism, rows: Rows, source: Source = "run"): string {
  const length = rowLength(m);
  const of = m.outputs.filter(({ run }) => !run || source === "run");
  const places = of.map((output) => outputPlace(m, m.outputs.indexOf(output)));
  const lines = [["time", ...of.map((output) => output.name)].join(",")];
  for (let row = 0; row < rows.count; row++) {
    const start = row * length;
    lines.push([rows.values[start], ...places.map((place) => rows.values[start + place])].join(","));
  }
  return `${lines.join("\n")}\n`;
}

/** The state in the address of the page. */
export function pageAddress(state: State): string {
  const bytes = new TextEncoder().encode(JSON.stringify(state));
  const text = btoa(String.fromCharCode(...bytes))
    .replaceAll("+", "-")
    .replaceAll("/", "_")
    .replaceAll("=", "");
  return `${location.href.split("#")[0]}#state=${text}`;
}

/** The state that an address holds, if it holds one; an Error says what is wrong with it. */
export function readState(address: string, tables: Tables): State | undefined {
  const text = /#state=([^&]+)$/.exec(address)?.[1];
  if (!text) return undefined;
  let data: unknown;
  try {
    const bytes = Uint8Array.from(atob(text.replaceAll("-", "+").replaceAll("_", "/")), (c) =>
      c.charCodeAt(0),
    );
    data = JSON.parse(new TextDecoder().decode(bytes));
  } catch {
    throw new Error("the state in the address is damaged: a part of the link may be missing");
  }
  return checkState(data, tables);
}

/** What is saved: the motion, and the drawing in its forms. */
export interface Saved {
  mechanism: Mechanism;
  state: State;
  duration: number;
  rows?: Rows;
  source?: Source;
  orbit?: Orbit;
  drawing: { svgText(): string; drawn(): Drawn[]; size: [number, number] };
}

/** Save in one of the forms of the list. */
export async function saveAs(
  form: string,
  { mechanism: m, state, duration, rows, source, orbit, drawing }: Saved,
): Promise<void> {
  const text = (name: string, type: string, content: string): void =>
    save(name, new Blob([content], { type }));
  const forms: Record<string, () => void | Promise<void>> = {
    case: () => text("case.toml", "application/toml", caseText(m, state, duration)),
    python: () => text("case.py", "text/x-python", pythonText(m, state, duration, orbit)),
    ssv: () => text("parameters.ssv", "application/xml", parameterText(m, state)),
    dxf: () => text("drawing.dxf", "image/vnd.dxf", dxfText(drawing.drawn())),
    svg: () => text("drawing.svg", "image/svg+xml", drawing.svgText()),
    table: () => rows && text("motion.csv", "text/csv", tableText(m, rows, source)),
    png: async () => {
      const back = getComputedStyle(document.body).getPropertyValue("--card");
      save("drawing.png", await pixels(drawing.svgText(), ...drawing.size, back));
    },
  };
  await forms[form]?.();
}

/** Let the browser save a file. */
export function save(name: string, content: Blob): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(content);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

/** A drawing as a picture of pixels, on the colour of the page. */
export async function pixels(svg: string, width: number, height: number, back: string): Promise<Blob> {
  const image = new Image();
  image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(svg)}`;
  await image.decode();
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [2 * width, 2 * height];
  const context = canvas.getContext("2d")!;
  context.fillStyle = back;
  context.fillRect(0, 0, canvas.width, canvas.height);
  context.drawImage(image, 0, 0, canvas.width, canvas.height);
  return new Promise((resolve, reject) =>
    canvas.toBlob((blob) => (blob ? resolve(blob) : reject(new Error("no picture was made"))), "image/png"),
  );
}
