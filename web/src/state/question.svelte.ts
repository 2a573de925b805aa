/** A question to the gateway with its last answer: a page shows from it what it knows, and how old that is. */
import type { Answer } from "../api/client.ts";
import type { Failure } from "../api/failure.ts";
import { failureOf } from "../api/failure.ts";
import { hall } from "./hall.svelte.ts";
import { session } from "./session.svelte.ts";

export class Question<T> {
  /** The last answer; `null` before the first one. It stays when a later question fails. */
  value = $state.raw<T | null>(null);
  /** Why the last question had no answer; `null` if it had one, or none was asked. */
  failure = $state.raw<Failure | null>(null);
  /** When the question of `value` was asked, on the page's clock. */
  at = $state<number | null>(null);
  isAsking = $state(false);
  #ask: () => Promise<Answer<T>>;
  #number = 0;

  constructor(ask: () => Promise<Answer<T>>) {
    this.#ask = ask;
  }

  /** Whether `value` may be another one by now: the last question failed, or the gateway is not heard. */
  get isOld(): boolean {
    return this.value !== null && (this.failure !== null || hall.since !== null);
  }

  /** Asks. Of several questions only the answer to the last one counts. */
  async ask(): Promise<void> {
    const number = ++this.#number;
    const at = performance.now();
    this.isAsking = true;
    const answer = await this.#ask();
    if (number !== this.#number) return;
    this.isAsking = false;
    this.failure = failureOf(answer);
    if (answer.kind !== "ok") return;
    this.value = answer.value;
    this.at = at;
  }

  /** Takes an answer that another request brought. */
  take(value: T): void {
    this.#number += 1;
    this.isAsking = false;
    this.failure = null;
    this.value = value;
    this.at = performance.now();
  }

  /** Forgets the answer: the next one is to another question. */
  forget(): void {
    this.#number += 1;
    this.isAsking = false;
    this.value = this.failure = this.at = null;
  }

  /**
   * Asks now, and again after each `every` milliseconds while somebody uses the page: each question keeps the
   * session open. Returns what ends it. For an `$effect`.
   */
  follow(every: number): () => void {
    void this.ask();
    const timer = setInterval(() => {
      if (session.isUsed && hall.since === null && !this.isAsking) void this.ask();
    }, every);
    return () => {
      clearInterval(timer);
      this.#number += 1;
      this.isAsking = false;
    };
  }
}
