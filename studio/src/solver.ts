/** The worker, given the newest task when it is done with the one before. */

import { Background } from "./background";
import type { Mechanism } from "./tables";
import type { Answer, Task } from "./worker";

export interface SolverListener {
  answered(answer: Answer, newest: boolean): void;
  /** A task was given up. */
  failed(sentence: string): void;
}

export class Solver {
  private readonly background: Background<Answer>;
  private id = 0;
  private busy = false;
  private next: Task | undefined;

  constructor(listener: SolverListener) {
    this.background = new Background(
      (answer) => {
        this.go();
        listener.answered(answer, answer.id === this.id);
      },
      (sentence) => {
        this.go();
        listener.failed(sentence);
      },
    );
  }

  /** The next tasks are of this mechanism. */
  use(mechanism: Mechanism, bytes: ArrayBuffer): void {
    this.background.use(mechanism, bytes);
  }

  ask(task: Omit<Task, "id">): void {
    this.next = { ...task, id: ++this.id };
    if (!this.busy) this.go();
  }

  private go(): void {
    const task = this.next;
    this.next = undefined;
    this.busy = task !== undefined;
    if (task) this.background.give(task);
  }
}
