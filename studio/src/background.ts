/** Workers beside the page: one that fails is begun anew, and nothing of what it was doing is left. */

import type { Exploration, Found } from "./explore";
import type { Mechanism } from "./tables";
import type { Answer, Part, Task } from "./worker";

abstract class Background<News> {
  private worker: Worker | undefined;
  private mechanism: Mechanism | undefined;
  private bytes: ArrayBuffer | undefined;
  /** Whether the worker has the module of the mechanism. */
  private has = false;
  /** Of the newest task. */
  protected id = 0;

  protected abstract heard(news: News): void;
  protected abstract failed(sentence: string): void;

  /** What is given from now on is of this mechanism. */
  use(mechanism: Mechanism, bytes: ArrayBuffer): void {
    this.mechanism = mechanism;
    this.bytes = bytes;
    this.has = false;
  }

  protected give(task: object): void {
    const whole = this.has ? task : { ...task, mechanism: this.mechanism, bytes: this.bytes };
    this.worker ??= this.begun();
    this.has = true;
    this.worker.postMessage(whole);
  }

  /** Tell the worker, if there is one, what needs no answer. */
  protected tell(task: object): void {
    this.worker?.postMessage(task);
  }

  private begun(): Worker {
    const worker = new Worker(URL.createObjectURL(new Blob([WORKER], { type: "text/javascript" })));
    worker.addEventListener("message", ({ data }: MessageEvent<News>) => this.heard(data));
    for (const kind of ["error", "messageerror"])
      worker.addEventListener(kind, (event) => {
        event.preventDefault();
        worker.terminate();
        this.worker = undefined;
        this.has = false;
        const why = event instanceof ErrorEvent && event.message ? ` (${event.message})` : "";
        this.failed(
          `the computation broke off${why}: what is shown is older; the next change begins it anew`,
        );
      });
    return worker;
  }
}

/** Motions: the worker is given the newest task when it is done with the one before. */
export class Solver extends Background<Answer> {
  private busy = false;
  private next: Task | undefined;

  constructor(
    private readonly answered: (answer: Answer, newest: boolean) => void,
    private readonly gaveUp: (sentence: string) => void,
  ) {
    super();
  }

  protected heard(answer: Answer): void {
    this.go();
    this.answered(answer, answer.id === this.id);
  }

  protected failed(sentence: string): void {
    this.go();
    this.gaveUp(sentence);
  }

  ask(task: Omit<Task, "id">): void {
    this.next = { ...task, id: ++this.id };
    if (!this.busy) this.go();
  }

  private go(): void {
    const task = this.next;
    this.next = undefined;
    this.busy = task !== undefined;
    if (task) this.give(task);
  }
}

/** Searches: what is found comes in parts, and what is asked anew takes the place of what was asked. */
export class Explorer extends Background<Part> {
  constructor(private readonly found: (parts: Found[], done: boolean) => void) {
    super();
  }

  protected heard(part: Part): void {
    if (part.search === this.id) this.found(part.found, part.done);
  }

  protected failed(sentence: string): void {
    this.found([{ part: 0, sentence }], true);
  }

  ask(exploration: Exploration): void {
    this.give({ search: ++this.id, exploration });
  }

  /** What is under way is of no use any more. */
  stop(): void {
    this.tell({ search: ++this.id });
  }
}
