/** The server that `linkwork studio` opens the page from: one job at a time, followed until it is done. */

import type { State, Values } from "./tables";
import type { Point } from "./view";

export interface Job {
  state: "idle" | "running" | "done" | "failed" | "cancelled";
  kind?: string;
  what?: string;
  share?: number;
  /** What came of it, as JSON. */
  answer?: string;
  sentence?: string;
}

/** What a job answers, as far as it has it: analysis/server/jobs.py. */
export interface Answer {
  words: string;
  table?: { headings: string[]; rows: string[][] };
  states?: State[];
  curves?: Point[][];
  closed?: boolean;
  charts?: { title: string; unit: string; x: number[]; y: number[] }[];
  files?: { name: string; base64: string }[];
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

export class Server {
  private constructor(private readonly token: string) {}

  /** The server that this page came from; undefined where it is a file. */
  static here(): Server | undefined {
    const token = new URLSearchParams(location.search).get("token");
    return token && document.querySelector('meta[name="linkwork-server"]') ? new Server(token) : undefined;
  }

  async give(kind: string, state: Request, wanted: object): Promise<Job> {
    return this.ask("POST", JSON.stringify({ kind, state, wanted }));
  }

  async look(): Promise<Job> {
    return this.ask("GET");
  }

  async cancel(): Promise<Job> {
    return this.ask("DELETE");
  }

  /** The end of the job that is being done; `told` hears of how it goes on. */
  async follow(told: (job: Job) => void): Promise<Job> {
    for (;;) {
      const job = await this.look();
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
