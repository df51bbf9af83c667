/** A second worker: what it finds comes in parts, and what is asked anew takes the place of what was asked. */

import type { Exploration, Found } from "./explore";
import type { Mechanism } from "./tables";
import type { Part, Search } from "./worker";

export class Explorer {
  private readonly worker = new Worker(URL.createObjectURL(new Blob([WORKER], { type: "text/javascript" })));
  private id = 0;
  private mechanism: Mechanism | undefined;
  private bytes: ArrayBuffer | undefined;

  constructor(found: (parts: Found[], done: boolean) => void) {
    this.worker.addEventListener("message", ({ data }: MessageEvent<Part>) => {
      if (data.search === this.id) found(data.found, data.done);
    });
  }

  use(mechanism: Mechanism, bytes: ArrayBuffer): void {
    this.mechanism = mechanism;
    this.bytes = bytes;
  }

  ask(exploration: Exploration): void {
    const task: Search = { search: ++this.id, exploration };
    if (this.bytes) Object.assign(task, { mechanism: this.mechanism, bytes: this.bytes });
    this.bytes = undefined;
    this.worker.postMessage(task);
  }

  /** What is under way is of no use any more. */
  stop(): void {
    this.worker.postMessage({ search: ++this.id });
  }
}
