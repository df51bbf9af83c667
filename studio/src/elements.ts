/** What the forms of the page are made of, and fields that say what is wrong with what is in them. */

export type Child = Node | string;

/** Attributes that some browsers do not have as properties. */
type Spoken = { role?: string } & Record<`aria-${string}`, string>;

export function make<K extends keyof HTMLElementTagNameMap>(
  kind: K,
  properties: Partial<HTMLElementTagNameMap[K]> & Spoken = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const made = document.createElement(kind);
  for (const [name, value] of Object.entries(properties))
    if (/^role$|^aria-/.test(name)) made.setAttribute(name, value as string);
    else Object.assign(made, { [name]: value });
  made.append(...children);
  return made;
}

export const line = (...children: Child[]): HTMLElement => make("div", { className: "line" }, ...children);

export function button(text: string, action: () => void): HTMLButtonElement {
  const made = make("button", { textContent: text, type: "button" });
  made.addEventListener("click", action);
  return made;
}

export function tick(label: string, checked: boolean): [HTMLLabelElement, HTMLInputElement] {
  const field = make("input", { type: "checkbox", checked });
  return [make("label", {}, field, ` ${label}`), field];
}

/** A part that opens; only one is open at a time. */
export function part(title: string, ...children: Child[]): HTMLDetailsElement {
  const made = make("details", {}, make("summary", { textContent: title }), ...children);
  made.setAttribute("name", "python");
  return made;
}

/** What is wrong with what a form has, in a sentence, and where. */
export class Wrong extends Error {
  constructor(
    sentence: string,
    readonly field?: HTMLElement,
  ) {
    super(sentence);
  }
}

/** What a number must be; `missing` is what an empty field stands for, which else is wrong. */
export interface Rule {
  above?: number;
  least?: number;
  below?: number;
  whole?: boolean;
  missing?: number;
}

/** The number of a text, or what is wrong with it. */
export function readNumber(text: string, name: string, unit: string, rule: Rule): number {
  const written = text.trim();
  if (written === "" && rule.missing !== undefined) return rule.missing;
  const value = written === "" ? Number.NaN : Number(written);
  const { above = -Infinity, least = -Infinity, below = Infinity, whole = false } = rule;
  if (
    Number.isFinite(value) &&
    value > above &&
    value >= least &&
    value < below &&
    (!whole || value % 1 === 0)
  )
    return value;
  const bounds = [
    ...(Number.isFinite(above) ? [`above ${above}`] : []),
    ...(Number.isFinite(least) ? [`at least ${least}`] : []),
    ...(Number.isFinite(below) ? [`below ${below}`] : []),
  ].join(" and ");
  const said = written === "" ? "has no number" : `is ${written}${unit && ` ${unit}`}`;
  throw new Wrong(
    `"${name}" ${said}: it must be a ${whole ? "whole " : ""}number${bounds && ` ${bounds}`}${unit && ` (${unit})`}`,
  );
}

/** A field of a number, and what reads it. */
export function number(
  label: string,
  unit: string,
  value: number | "",
  rule: Rule = { above: 0 },
): [HTMLLabelElement, () => number, HTMLInputElement] {
  const field = make("input", { type: "number", step: "any", value: String(value) });
  const read = (): number => {
    try {
      return readNumber(field.value, label, unit, rule);
    } catch (error) {
      throw new Wrong((error as Error).message, field);
    }
  };
  return [make("label", {}, `${label} `, field, unit && ` ${unit}`), read, field];
}
