/** The page in a frame of a notebook: its state goes to the page around it, and comes from there. */

import { type State, checkState, type Tables } from "./tables";

/** Whether the page was put into a frame as a text, which anywidget's part of it does (analysis/studio/widget.js). */
export const embedded = (): boolean => location.href === "about:srcdoc" && parent !== window;

export class Embed {
  constructor(
    tables: Tables,
    private readonly take: (state: State) => void,
    fault: (sentence: string) => void,
  ) {
    if (!embedded()) return;
    // the frame has no address that could be copied
    document.querySelector('#save option[value="link"]')?.remove();
    addEventListener("message", ({ source, data }: MessageEvent<{ linkwork?: unknown }>) => {
      if (source !== parent || !data?.linkwork) return;
      try {
        this.take(checkState(data.linkwork, tables));
      } catch (error) {
        fault((error as Error).message);
      }
    });
    parent.postMessage({ linkwork: "ready" }, "*");
  }

  /** What is shown now. */
  tell(state: State): void {
    if (embedded()) parent.postMessage({ linkwork: state }, "*");
  }
}
