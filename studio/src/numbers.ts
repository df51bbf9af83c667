/** All outputs at the instant that is drawn, as a table. */

import { make } from "./elements";
import { type Mechanism, outputPlace, type Source } from "./tables";
import { shown } from "./words";

export class Numbers {
  private readonly table = make("table");
  private readonly box = make(
    "details",
    { id: "numbers" },
    make("summary", { textContent: "Numbers at this instant" }),
    this.table,
  );
  private cells: HTMLTableCellElement[] = [];
  private mechanism!: Mechanism;

  show(mechanism: Mechanism, place: HTMLElement): void {
    this.mechanism = mechanism;
    this.table.replaceChildren();
    this.cells = mechanism.outputs.map((output) => {
      const line = this.table.insertRow();
      line.insertCell().textContent = output.name;
      line.title = output.text;
      return line.insertCell();
    });
    place.append(this.box);
  }

  /** The numbers of a row of a motion; those that are rounding are none. */
  write(row: Float64Array, roundings: Map<string, number>, source: Source): void {
    if (!this.box.open) return;
    const m = this.mechanism;
    m.outputs.forEach((output, n) => {
      this.table.rows[n].hidden = output.run === true && source === "steady";
      const value = row[outputPlace(m, n)];
      const rounding = Math.abs(value) <= (roundings.get(output.unit) ?? 0);
      this.cells[n].textContent = shown(rounding ? 0 : value, output, 6);
      this.cells[n].dataset.value = String(value);
    });
  }
}
