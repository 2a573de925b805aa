/** How old a value is, and how that is shown. */
import type { Value } from "./store.ts";

/** From this age on, in milliseconds, a value is not shown any more. */
export const DEAD = 5_000;

export type Shown = { kind: "fresh" } | { kind: "stale"; age: number } | { kind: "dead"; age: number | null };

/**
 * How to show a value. A fresh value stays fresh for as long as the gateway is heard: it tells only changes,
 * also that a value became stale. `heard` is when the gateway was last heard, if it is lost now; else `null`.
 */
export function shown(value: Value | undefined, now: number, heard: number | null): Shown {
  if (value === undefined || value.asked === null || value.quality === "none") return { kind: "dead", age: null };
  if (value.quality === "fresh" && heard === null) return { kind: "fresh" };
  const age = Math.max(0, now - (value.quality === "fresh" ? (heard ?? now) : value.asked));
  return age > DEAD ? { kind: "dead", age } : { kind: "stale", age };
}
