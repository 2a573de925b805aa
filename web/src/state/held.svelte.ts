/** The order of a list that holds still while somebody points at it or is in it with the keys. */
import { type Entry, frozen } from "../robots/attention.ts";

export class Held {
  #keys = $state.raw<string[] | null>(null);
  readonly #entries: () => Entry[];

  /** `entries`: all of them, in their present order. */
  constructor(entries: () => Entry[]) {
    this.#entries = entries;
  }

  /** What to show, and how many came since the order holds still. */
  get list(): { entries: Entry[]; waiting: number } {
    const entries = this.#entries();
    return this.#keys === null ? { entries, waiting: 0 } : frozen(this.#keys, entries);
  }

  #hold = (): void => {
    this.#keys ??= this.#entries().map((entry) => entry.key);
  };

  #release = (): void => {
    this.#keys = null;
  };

  /** For the element round the list. */
  readonly on = {
    onpointerenter: this.#hold,
    onpointerleave: this.#release,
    onfocusin: this.#hold,
    onfocusout: this.#release,
  };
}
