/** What one chart has read: the history of its signals, and behind it what the live stream told since. */
import { type Bucket, Tail } from "./buckets.ts";
import type { Outcome } from "./load.ts";

/** What a bucket that was not read is. */
const nothing = (at: number, width: number): Bucket => ({ at, width, mean: null, min: null, max: null, seen: 0 });

/**
 * How long a value takes until it can be asked for, in milliseconds: the gateway writes four times a
 * second. So the end of the history is read a second time.
 */
export const LATE = 1_500;

export class Series {
  readonly from: number;
  /** Where the history ends and the tail begins. */
  readonly to: number;
  readonly width: number;
  readonly #history = new Map<string, Bucket[]>();
  readonly #tails: Map<string, Tail>;
  readonly outcomes = new Map<string, Outcome>();

  /** `most`: how many buckets of the tail are kept. */
  constructor(signals: string[], from: number, to: number, width: number, most: number) {
    this.from = from;
    this.to = to;
    this.width = width;
    this.#tails = new Map(signals.map((signal) => [signal, new Tail(to, width, most)]));
  }

  /** Takes in buckets of the history, as far as they are read. A wider one fills each place that it covers. */
  put(signal: string, buckets: Bucket[]): void {
    const row = Array.from({ length: Math.ceil((this.to - this.from) / this.width) }, (_, at) => {
      const begin = this.from + at * this.width;
      return nothing(begin, Math.min(this.width, this.to - begin));
    });
    for (const bucket of buckets) {
      const place = (time: number): number => Math.round((time - this.from) / this.width);
      const begin = place(bucket.at);
      const end = Math.max(begin + 1, bucket.width > this.width ? place(bucket.at + bucket.width) : 0);
      for (let at = Math.max(0, begin); at < Math.min(end, row.length); at += 1) {
        const { at: time, width } = row[at]!;
        row[at] = { ...bucket, at: time, width };
      }
    }
    this.#history.set(signal, row);
  }

  /** Where the end begins that is read a second time: at the begin of a bucket. */
  get end(): number {
    return this.from + Math.max(0, Math.floor((this.to - 2 * LATE - this.from) / this.width)) * this.width;
  }

  /** Takes in the end, read a second time. */
  mend(signal: string, buckets: Bucket[]): void {
    const before = this.#history.get(signal)?.filter(({ at }) => at < this.end) ?? [];
    this.put(signal, [...before, ...buckets]);
  }

  look(signal: string, at: number, value: number | null): void {
    this.#tails.get(signal)?.look(at, value);
  }

  /** Whether all signals were read, or could not be. */
  get isDone(): boolean {
    return this.outcomes.size >= this.#tails.size;
  }

  /** The buckets of each signal that end behind this time. All rows have the same times. */
  rows(after: number): { times: { at: number; width: number }[]; rows: Map<string, Bucket[]> } {
    const rows = new Map<string, Bucket[]>();
    for (const [signal, tail] of this.#tails) {
      if (!this.#history.has(signal)) this.put(signal, []);
      const all = [...this.#history.get(signal)!, ...tail.buckets];
      rows.set(signal, all.filter(({ at, width }) => at + width > after));
    }
    const times = [...(rows.values().next().value ?? [])].map(({ at, width }) => ({ at, width }));
    return { times, rows };
  }
}
