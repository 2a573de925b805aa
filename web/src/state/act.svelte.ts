/** What a person does with one request: whether it is under way, and what became of it. It is sent once. */
import type { Answer } from "../api/client.ts";
import type { Failure } from "../api/failure.ts";
import { settings } from "./settings.svelte.ts";

/** What became of what a person did, in words. With a failure, the text says what was tried. */
export interface Told {
  state: "under_way" | "done" | "bad";
  text: string;
  failure?: Failure;
  /** The refusal that the text tells of: in another language than English, the gateway's own words stand under it. */
  said?: Failure;
  /** Where on the page of a robot it is said. */
  part?: string;
}

export class Act {
  isUnderWay = $state(false);
  /** What was done, or tried, in the words of the page. */
  what = $state("");
  failure = $state.raw<Failure | null>(null);
  isDone = $state(false);

  /** `null`: nothing was done yet. */
  get told(): Told | null {
    const words = settings.words.ui;
    if (this.failure !== null) return { state: "bad", text: this.what, failure: this.failure };
    if (this.isUnderWay) return { state: "under_way", text: `${this.what}: ${words.sending}` };
    return this.isDone ? { state: "done", text: `${this.what}: ${words.done}` } : null;
  }

  /** Sends it. Returns what the gateway answered, or `null` if it was refused or that is not known. */
  async run<T>(what: string, request: () => Promise<Answer<T>>): Promise<{ value: T } | null> {
    if (this.isUnderWay) return null;
    this.isUnderWay = true;
    this.what = what;
    this.failure = null;
    this.isDone = false;
    const answer = await request();
    this.isUnderWay = false;
    if (answer.kind === "ok") {
      this.isDone = true;
      return { value: answer.value };
    }
    // Without an answer, the gateway may have done it.
    this.failure = answer.kind === "unknown" ? { code: "outcome_unknown", message: "" } : answer.problem;
    return null;
  }

  clear(): void {
    this.what = "";
    this.failure = null;
    this.isDone = false;
  }
}
