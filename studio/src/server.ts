/** The server that `linkwork studio` opens the page from: one job at a time, followed until it is done. */

import type { State, Values } from "./tables";
import type { Point } from "./view";

export interface Job {
  state: "idle" | "running" | "done" | "failed" | "cancelled";
  /** Its number, of all that the server has done. */
  job?: number;
  kind?: string;
  what?: string;
  share?: number;
  /** What came of it, as JSON. */
  answer?: string;
  sentence?: string;
}

export interface File {
  name: string;
  base64: string;
}

/** Lines of a small picture. */
export interface Small {
  links: Point[][];
  curves: Point[][];
}

/** What a job answers, as far as it has it: analysis/server/jobs.py. */
export interface Answer {
  words: string;
  table?: { headings: string[]; rows: string[][]; files?: File[][] };
  pictures?: Small[];
  /** By row; null of a linkage that is no mechanism of the page. */
  states?: (State | null)[];
  curves?: Point[][];
  closed?: boolean;
  charts?: { title: string; unit: string; axis: string; x: number[]; y: number[] }[];
  files?: File[];
  time?: number[];
  outputs?: Record<string, number[]>;
}

export interface Request {
  mechanism: string;
  title: string;
  values: Values;
  duration?: number;
}

const INTERVAL = 250;
const GONE = "Python does not answer: is linkwork studio still running in its terminal?";
const ANOTHER = "Another tab has begun a job since: what came of this one is gone.";

export class Server {
  private constructor(
    private readonly token: string,
    /** Of linkages that are searched. */
    readonly kinds: string[],
  ) {}

  /**
   * The server that this page came from; undefined where it is a file. The token leaves the address for the browser's
   * storage, so that no link that is copied has it; the server asks the storage when the page is loaded again.
   */
  static here(): Server | undefined {
    const token = new URLSearchParams(location.search).get("token");
    const mark = document.querySelector<HTMLMetaElement>('meta[name="linkwork-server"]');
    if (!token || !mark) return undefined;
    localStorage.setItem("linkwork-token", token);
    history.replaceState(null, "", location.pathname + location.hash);
    return new Server(token, mark.content.split(" "));
  }

  private given: Promise<Job> | undefined;

  give(kind: string, state: Request, wanted: object): Promise<Job> {
    this.given = this.ask("POST", JSON.stringify({ kind, state, wanted }));
    return this.given;
  }

  look = (): Promise<Job> => this.ask("GET");

  /** Cancel the job that is being done, also one whose beginning the server has not yet answered. */
  async cancel(): Promise<Job> {
    await this.given;
    return this.ask("DELETE");
  }

  /** The end of a job that is being done; `told` hears of how it goes on. */
  async follow(begun: Job, told: (job: Job) => void): Promise<Job> {
    for (;;) {
      const job = await this.look();
      if (job.job !== undefined && job.job !== begun.job) return { state: "failed", sentence: ANOTHER };
      if (job.state !== "running") return job;
      told(job);
      await new Promise((resolve) => setTimeout(resolve, INTERVAL));
    }
  }

  private async ask(method: string, body?: string): Promise<Job> {
    const headers: Record<string, string> = { "X-Linkwork-Token": this.token };
    if (body !== undefined) headers["Content-Type"] = "application/json";
    let answer: Response;
    try {
      answer = await fetch("/job", { method, headers, body });
    } catch {
      return { state: "failed", sentence: GONE };
    }
    const job = (await answer.json().catch(() => ({ sentence: answer.statusText }))) as Job;
    return answer.ok ? job : { state: "failed", sentence: job.sentence };
  }
}
