/** Figures as texts. What is not told is named, and never 0. */
import type { Production } from "../../api/types.ts";
import type { en } from "../../i18n/en.ts";
import { type Sum, type Tells, isUnseen, tellsCycles } from "./figures.ts";

type Words = typeof en;

export function availabilityOf(one: Production | undefined, { production }: Words): string {
  if (one === undefined) return "";
  return one.availability.value === null ? production.nothingSeen : production.percent(one.availability.value);
}

export function partsOf(one: Production | undefined, { production }: Words): string {
  if (one === undefined) return "";
  const { count, resets } = one.parts;
  if (count === null) return isUnseen(one) ? production.nothingSeen : production.notTold;
  return resets > 0 ? production.atLeast(String(count)) : String(count);
}

export function cyclesOf(one: Production | undefined, tells: ReadonlyMap<string, Tells>, { production }: Words): string {
  if (one === undefined) return "";
  if (!tellsCycles(one, tells) && isUnseen(one)) return production.nothingSeen;
  if (!tellsCycles(one, tells)) return tells.get(one.robot) === false ? production.notTold : production.notKnown;
  return one.cycles.at_least ? production.atLeast(String(one.cycles.count)) : String(one.cycles.count);
}

/** A time of a cycle; nothing without any. */
export function cycleTime(ms: number | null | undefined, { production }: Words): string {
  return ms == null ? "" : production.seconds(ms);
}

/** Up to which time a part of the cycles took; nothing without any. */
export function cyclesUpTo(ms: number | null | undefined, words: Words): string {
  return ms == null ? "" : words.production.upTo(cycleTime(ms, words));
}

/** A figure of the hall, and of how many robots it is if not all tell it. */
export function sumOf(sum: Sum, all: number, { production }: Words, text: (value: number) => string = String): string {
  if (sum.value === null) return all === 0 ? "" : sum.unseen.length === all ? production.nothingSeen : production.notTold;
  const value = sum.atLeast ? production.atLeast(text(sum.value)) : text(sum.value);
  return sum.of === all ? value : `${value} (${production.toldBy(sum.of, all)})`;
}

function signed(by: number): string {
  return by === 0 ? "0" : `${by < 0 ? "−" : "+"}${Math.abs(by)}`;
}

/** How much more the first one is; nothing if one of them is not known, or is of other robots. */
export function difference(a: Sum, b: Sum, text: (by: number) => string = signed): string {
  const others = (sum: Sum): string => [...sum.missing, ...sum.unseen].join();
  if (a.value === null || b.value === null || others(a) !== others(b) || a.of !== b.of) return "";
  if (a.atLeast || b.atLeast) return "";
  return text(a.value - b.value);
}
