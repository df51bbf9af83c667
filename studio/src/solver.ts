/** The worker, given the newest task when it is done with the one before. */

import { bytesOf } from "./core";
import type { Mechanism } from "./tables";
import type { Answer, Task } from "./worker";

export class Solver {
  private readonly worker = new Worker(URL.createObjectURL(new Blob([WORKER], { type: "text/javascript" })));
  private id = 0;
  private busy = false;
  private next: Task | undefined;
  private mechanism: Mechanism | undefined;

  constructor(answered: (answer: Answer, newest: boolean) => void) {
    this.worker.addEventListener("message", ({ data }: MessageEvent<Answer>) => {
      this.busy = false;
      const task = this.next;
      this.next = undefined;
      if (task) this.post(task);
      answered(data, data.id === this.id);
    });
  }

  /** The next tasks are of this mechanism. */
  async use(mechanism: Mechanism, bytes?: ArrayBuffer): Promise<void> {
    const made = bytes ?? (await bytesOf(mechanism));
    this.mechanism = mechanism;
    this.module = made;
  }

  private module: ArrayBuffer | undefined;

  ask(task: Omit<Task, "id">): void {
    const whole: Task = { ...task, id: ++this.id };
    if (this.mechanism) {
      whole.mechanism = this.mechanism;
      whole.bytes = this.module;
      this.mechanism = undefined;
    } else if (this.next?.mechanism) {
      whole.mechanism = this.next.mechanism;
      whole.bytes = this.next.bytes;
    }
    if (this.busy) this.next = whole;
    else this.post(whole);
  }

  private post(task: Task): void {
    this.busy = true;
    this.worker.postMessage(task);
  }
}
