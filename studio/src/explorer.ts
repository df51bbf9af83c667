/** A second worker: what it finds comes in parts, and what is asked anew takes the place of what was asked. */

import { Background } from "./background";
import type { Exploration, Found } from "./explore";
import type { Mechanism } from "./tables";
import type { Part } from "./worker";

export class Explorer {
  private readonly background: Background<Part>;
  private id = 0;

  constructor(found: (parts: Found[], done: boolean) => void) {
    this.background = new Background(
      (part) => part.search === this.id && found(part.found, part.done),
      (sentence) => found([{ part: 0, sentence }], true),
    );
  }

  use(mechanism: Mechanism, bytes: ArrayBuffer): void {
    this.background.use(mechanism, bytes);
  }

  ask(exploration: Exploration): void {
    this.background.give({ search: ++this.id, exploration });
  }

  /** What is under way is of no use any more. */
  stop(): void {
    this.background.tell({ search: ++this.id });
  }
}
