/** How old a value is, and how that is shown. */
import type { Value } from "./store.ts";

/** From this age on, in milliseconds, a value is not shown any more. */
export const DEAD = 5_000;

/** A value that is read less often than this, in milliseconds, is never said to be one of now. */
export const SLOW = 1_000;
/**
 * Where values are read less often than this, in milliseconds, one that the gateway calls fresh may be older
 * than 5 s: it may come 1 s after it was due.
 */
export const SELDOM = 4_000;

export type Shown =
  | { kind: "fresh" }
  /** It is read seldom: it may be as old as `age`, and the gateway does not tell when it was read last. */
  | { kind: "slow"; age: number }
  | { kind: "stale"; age: number }
  | { kind: "dead"; age: number | null };

/**
 * How to show a value that is read with this period. A fresh value stays fresh for as long as the gateway is
 * heard: it tells only changes, also that a value became stale. `heard` is when the gateway was last heard, if
 * it is lost or silent now; else `null`.
 */
export function shown(value: Value | undefined, now: number, heard: number | null, period: number): Shown {
  if (value === undefined || value.asked === null || value.quality === "none") return { kind: "dead", age: null };
  // It was read within a period, and some time to spare: its value may be older than its last reading.
  const most = period > SLOW ? Math.min(period + 1_000, Math.max(0, (heard ?? now) - value.asked)) : 0;
  if (value.quality === "fresh" && heard === null) return most > SLOW ? { kind: "slow", age: most } : { kind: "fresh" };
  const age = Math.max(0, now - (value.quality === "fresh" ? (heard ?? now) - most : value.asked));
  return age > DEAD ? { kind: "dead", age } : { kind: "stale", age };
}
