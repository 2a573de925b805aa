/** Asks robots for figures, one after the other, and says how far it is. */
import { type Failure, failureOf } from "./failure.ts";
import { patiently } from "./patiently.ts";

/** What is asked of one robot. */
export interface Question {
  key: string;
  robot: string;
  path: string;
}

export class Gather<T> {
  done = $state(0);
  all = $state(0);
  isRunning = $state(false);
  /** By the keys of the questions. */
  answers = $state.raw(new Map<string, T>());
  failures = $state.raw(new Map<string, { robot: string; failure: Failure }>());
  /** When the last answer came, as milliseconds since 1970; `null` before. */
  at = $state<number | null>(null);
  #stop: AbortController | null = null;

  /** Begins anew. What was under way is given up. */
  async run(questions: Question[], now: () => number): Promise<void> {
    this.end();
    const stop = new AbortController();
    this.#stop = stop;
    [this.done, this.all, this.isRunning] = [0, questions.length, true];
    [this.answers, this.failures] = [new Map(), new Map()];
    for (const { key, robot, path } of questions) {
      const answer = await patiently<T>(path, stop.signal);
      if (stop.signal.aborted) return;
      const failure = failureOf(answer);
      if (failure !== null) this.failures = new Map(this.failures).set(key, { robot, failure });
      if (answer.kind === "ok") this.answers = new Map(this.answers).set(key, answer.value);
      this.done += 1;
      this.at = now();
    }
    this.isRunning = false;
  }

  end(): void {
    this.#stop?.abort();
    this.#stop = null;
    this.isRunning = false;
  }
}
