/** A worker that is begun anew where it fails: nothing of what it was doing is left. */

import type { Mechanism } from "./tables";

export class Background<Answer> {
  private worker: Worker | undefined;
  private mechanism: Mechanism | undefined;
  private bytes: ArrayBuffer | undefined;
  /** Whether the worker has the module of the mechanism. */
  private has = false;

  constructor(
    private readonly heard: (answer: Answer) => void,
    private readonly failed: (sentence: string) => void,
  ) {}

  /** What is given from now on is of this mechanism. */
  use(mechanism: Mechanism, bytes: ArrayBuffer): void {
    this.mechanism = mechanism;
    this.bytes = bytes;
    this.has = false;
  }

  give(task: object): void {
    const whole = this.has ? task : { ...task, mechanism: this.mechanism, bytes: this.bytes };
    this.worker ??= this.begun();
    this.has = true;
    this.worker.postMessage(whole);
  }

  /** Tell the worker, if there is one, what needs no answer. */
  tell(task: object): void {
    this.worker?.postMessage(task);
  }

  private begun(): Worker {
    const worker = new Worker(URL.createObjectURL(new Blob([WORKER], { type: "text/javascript" })));
    worker.addEventListener("message", ({ data }: MessageEvent<Answer>) => this.heard(data));
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
