/** The two spans that are compared: days or shifts of the hall. Pure: times are milliseconds since 1970. */
import type { Shift } from "../../api/types.ts";
import { beginOf, dayAfter, dayOf, instantOf, wall } from "../../i18n/zone.ts";

export type Period =
  /** `isPart`: it ends before the day does. */
  | { kind: "day"; day: string; from: number; to: number; isPart: boolean }
  | { kind: "shift"; name: string; date: string; isUnderWay: boolean };

const WEEKDAYS = ["sun", "mon", "tue", "wed", "thu", "fri", "sat"] as const;

/** The query of a period, for the figures of production. */
export function queryOf(period: Period): string {
  if (period.kind === "shift") return new URLSearchParams({ shift: period.name, date: period.date }).toString();
  const [from, to] = [period.from, period.to].map((at) => new Date(at).toISOString()) as [string, string];
  return new URLSearchParams({ from, to }).toString();
}

/**
 * A day of the hall, up to now at most. With `until`, a time on the wall such as `10:42:03`, it ends there,
 * so that two days can be compared. `null` if the text is no day, or the day has not begun.
 */
export function dayPeriod(day: string, now: number, zone: string, until: string | null = null): Period | null {
  const [from, next] = [beginOf(day, zone), isDay(day) ? beginOf(dayAfter(day, 1), zone) : null];
  if (from === null || next === null || from >= now) return null;
  const wanted = until === null ? next : (instantOf(`${day}T${until}`, zone) ?? next);
  const to = Math.min(wanted, next, now);
  return to <= from ? null : { kind: "day", day, from, to, isPart: to < next };
}

function isDay(text: string): boolean {
  return /^\d{4}-\d\d-\d\d$/.test(text) && !Number.isNaN(Date.parse(`${text}T00:00:00Z`));
}

/**
 * Two days beside each other. Beside today, the other day ends at the same time, unless `whole` is in the
 * query.
 */
export function daysOf(query: URLSearchParams, now: number, zone: string): [Period | null, Period | null] {
  const today = dayOf(now, zone);
  const first = query.get("a") ?? today;
  const second = query.get("b") ?? dayAfter(isDay(first) ? first : today, -1);
  const until = first === today && query.get("whole") === null ? wall(now, zone).slice(11) : null;
  return [dayPeriod(first, now, zone), dayPeriod(second, now, zone, until)];
}

/** The shifts that began in the last `days` days, the latest first. */
export function shiftsOf(shifts: Shift[], now: number, zone: string, days: number): (Period & { kind: "shift"; from: number })[] {
  const found: (Period & { kind: "shift"; from: number })[] = [];
  const today = dayOf(now, zone);
  for (let back = 0; back < days; back += 1) {
    const date = dayAfter(today, -back);
    const weekday = WEEKDAYS[new Date(`${date}T00:00:00Z`).getUTCDay()];
    for (const { name, days: on, begin, end } of shifts) {
      const from = instantOf(`${date}T${begin}`, zone);
      if (weekday === undefined || !on.includes(weekday) || from === null || from >= now) continue;
      const isNext = end <= begin || end === "24:00";
      const to = instantOf(`${isNext ? dayAfter(date, 1) : date}T${end === "24:00" ? "00:00" : end}`, zone);
      found.push({ kind: "shift", name, date, from, isUnderWay: to !== null && to > now });
    }
  }
  return found.sort((a, b) => b.from - a.from);
}

/** Whether counts of the two can be subtracted: neither or both end before the day or the shift does. */
export function areAlike(a: Period, b: Period): boolean {
  const isPart = (one: Period): boolean => (one.kind === "day" ? one.isPart : one.isUnderWay);
  // A shift under way has no end yet: how long another one would be up to now is not told.
  return isPart(a) === isPart(b) && !(a.kind === "shift" && a.isUnderWay);
}

/** How a shift of a day stands in the query: `night@2026-11-25`. */
export function shiftKey({ name, date }: { name: string; date: string }): string {
  return `${name}@${date}`;
}

/** Two shifts beside each other: the latest one, and the same one of an earlier day if there is one. */
export function pairOf(query: URLSearchParams, all: (Period & { kind: "shift" })[]): [Period | null, Period | null] {
  const named = (key: string): Period | undefined => all.find((one) => shiftKey(one) === query.get(key));
  const first = named("a") ?? all[0];
  if (first?.kind !== "shift") return [null, null];
  const earlier = all.filter((one) => one.date < first.date);
  const second = named("b") ?? earlier.find((one) => one.name === first.name) ?? all.find((one) => one !== first);
  return [first, second ?? null];
}
