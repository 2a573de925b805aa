/** Buckets: what a signal was in each part of a span. Pure: times are milliseconds since 1970. */
import type { HistoryBucket } from "../api/types.ts";

/** What a signal was in a part of the span. */
export interface Bucket {
  at: number;
  width: number;
  mean: number | null;
  min: number | null;
  max: number | null;
  /** How much of it has a value, from 0 to 1. */
  seen: number;
}

/** Widths below this, in milliseconds, say no more: a robot is not read more often than every 20 ms. */
const NARROWEST = 20;
/** What is missing of a bucket without being a gap, as a part of it: rounding. */
const ROUNDING = 0.001;

/** The width of a bucket, in whole milliseconds, so that each bucket fills one pixel. */
export function widthOf(span: number, pixels: number): number {
  return Math.max(NARROWEST, Math.ceil(span / Math.max(1, Math.floor(pixels))));
}

/** The buckets of an answer. The last one may end before its width, with the range. */
export function bucketsOf(answer: HistoryBucket[], width: number, to: number): Bucket[] {
  return answer.map(({ time, mean, min, max, good_ms }) => {
    const at = Date.parse(time);
    const own = Math.max(1, Math.min(width, to - at));
    return { at, width: own, mean, min, max, seen: Math.min(1, good_ms / own) };
  });
}

/**
 * Whether a line may be drawn from a bucket to the next one: both have a value for all of their time. So a
 * gap that is narrower than a bucket is shown too.
 */
export function joins(a: Bucket | undefined, b: Bucket | undefined): boolean {
  if (a === undefined || b === undefined || a.mean === null || b.mean === null) return false;
  return a.seen >= 1 - ROUNDING && b.seen >= 1 - ROUNDING && Math.abs(b.at - a.at - a.width) <= 1;
}

/** The points of lines: `null` where a line ends. Each bucket is two points, at its middle and at its end. */
export function columns(times: { at: number; width: number }[], rows: (Bucket | undefined)[][]): [number[], ...(number | null)[][]] {
  const x: number[] = [];
  for (const { at, width } of times) x.push((at + width / 2) / 1000, (at + width) / 1000);
  const y = rows.map((row) =>
    times.flatMap((_, at): (number | null)[] => {
      const [here, next] = [row[at], row[at + 1]];
      const mean = here?.mean ?? null;
      if (!joins(here, next)) return [mean, null];
      // The line between the two middles goes through here.
      const { width } = here as Bucket;
      const part = width / (width + (next as Bucket).width);
      return [mean, (mean as number) + ((next as Bucket).mean! - (mean as number)) * part];
    }),
  );
  return [x, ...y];
}

/** Joins buckets until at most `most` are left, for a table. Means are weighted by the time that has a value. */
export function coarse(buckets: Bucket[], most: number): Bucket[] {
  const each = Math.max(1, Math.ceil(buckets.length / Math.max(1, most)));
  const joined: Bucket[] = [];
  for (let at = 0; at < buckets.length; at += each) joined.push(join(buckets.slice(at, at + each)));
  return joined;
}

/** All of these as one. */
export function join(buckets: Bucket[]): Bucket {
  const numbers = buckets.filter((one) => one.mean !== null);
  const width = sum(buckets.map((one) => one.width));
  const good = sum(buckets.map((one) => one.seen * one.width));
  const weight = sum(numbers.map((one) => one.seen * one.width));
  const mins = buckets.map((one) => one.min).filter((one) => one !== null);
  const maxs = buckets.map((one) => one.max).filter((one) => one !== null);
  return {
    at: buckets[0]?.at ?? 0,
    width,
    mean: weight > 0 ? sum(numbers.map((one) => one.mean! * one.seen * one.width)) / weight : null,
    min: mins.length > 0 ? mins.reduce((a, b) => Math.min(a, b)) : null,
    max: maxs.length > 0 ? maxs.reduce((a, b) => Math.max(a, b)) : null,
    seen: width > 0 ? good / width : 0,
  };
}

function sum(numbers: number[]): number {
  return numbers.reduce((all, one) => all + one, 0);
}

/** The lowest and the highest value, with some room; `null` without any. */
export function extent(rows: Bucket[][]): [number, number] | null {
  let [low, high] = [Infinity, -Infinity];
  for (const { min, max, mean } of rows.flat()) {
    low = Math.min(low, min ?? mean ?? Infinity);
    high = Math.max(high, max ?? mean ?? -Infinity);
  }
  if (low > high) return null;
  const room = high === low ? Math.max(1, Math.abs(high) * 0.1) : (high - low) * 0.05;
  return [low - room, high + room];
}

/**
 * What came over the live stream since the history was read, in buckets of the same width. A value counts
 * from one look to the next, if it is known at both. A look without a value begins a gap.
 */
export class Tail {
  readonly #begin: number;
  readonly #width: number;
  readonly #most: number;
  #buckets: (Bucket & { weight: number })[] = [];
  #last: { at: number; value: number | null } | null = null;

  /** `most`: how many buckets are kept; the oldest go. */
  constructor(begin: number, width: number, most: number) {
    this.#begin = begin;
    this.#width = width;
    this.#most = most;
  }

  /** Takes in a look at the value; `null` if it is not known now. */
  look(at: number, value: number | null): void {
    const before = this.#last;
    this.#last = { at, value };
    if (before === null || at <= before.at) return;
    // A page that slept has seen nothing.
    const isKnown = before.value !== null && value !== null && at - before.at <= Tail.SLEPT;
    for (let from = Math.max(before.at, this.#begin); from < at; ) {
      const bucket = this.#at(from);
      const end = Math.min(at, bucket.at + this.#width);
      bucket.width = end - bucket.at;
      if (isKnown) {
        const held = before.value as number;
        bucket.mean = ((bucket.mean ?? 0) * bucket.weight + held * (end - from)) / (bucket.weight + end - from);
        bucket.weight += end - from;
        for (const one of end === at ? [held, value as number] : [held]) {
          bucket.min = Math.min(bucket.min ?? one, one);
          bucket.max = Math.max(bucket.max ?? one, one);
        }
      }
      bucket.seen = bucket.weight / bucket.width;
      from = end;
    }
  }

  /** A look that comes later than this after the one before, in milliseconds, is a new beginning. */
  static readonly SLEPT = 3_000;

  get buckets(): Bucket[] {
    return this.#buckets;
  }

  #at(time: number): Bucket & { weight: number } {
    const start = this.#begin + Math.floor((time - this.#begin) / this.#width) * this.#width;
    let bucket = this.#buckets.at(-1);
    if (bucket === undefined || bucket.at < start) {
      bucket = { at: start, width: 0, mean: null, min: null, max: null, seen: 0, weight: 0 };
      this.#buckets.push(bucket);
      if (this.#buckets.length > this.#most) this.#buckets.shift();
    }
    return bucket;
  }
}
