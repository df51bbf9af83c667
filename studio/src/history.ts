/** What was done, to be undone and done again. */

export class History<T> {
  private past: string[] = [];
  private future: string[] = [];

  constructor(private now: string) {}

  /** Keep a state, if it is another than the last. */
  keep(state: T): void {
    const text = JSON.stringify(state);
    if (text === this.now) return;
    this.past.push(this.now);
    this.now = text;
    this.future = [];
  }

  undo(): T | undefined {
    return this.move(this.past, this.future);
  }

  redo(): T | undefined {
    return this.move(this.future, this.past);
  }

  get canUndo(): boolean {
    return this.past.length > 0;
  }

  get canRedo(): boolean {
    return this.future.length > 0;
  }

  private move(from: string[], to: string[]): T | undefined {
    const text = from.pop();
    if (text === undefined) return undefined;
    to.push(this.now);
    this.now = text;
    return JSON.parse(text) as T;
  }
}
