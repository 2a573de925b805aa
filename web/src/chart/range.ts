/** The span of a chart, as it stands in the query of the address. */
import { instantOf, wall } from "../i18n/zone.ts";

const MINUTE = 60_000;
const HOUR = 60 * MINUTE;
const DAY = 24 * HOUR;

/** The spans that end now, in milliseconds, by their words in the address. */
export const SPANS = {
  "1m": MINUTE,
  "15m": 15 * MINUTE,
  "8h": 8 * HOUR,
  "7d": 7 * DAY,
  "1y": 365 * DAY,
} as const;

export type Span = keyof typeof SPANS;

/** The longest span that the gateway answers, in milliseconds: ten years. */
export const LONGEST = 10 * 366 * DAY;

/** What a chart shows. Times are milliseconds since 1970. */
export type Range =
  /** Up to now, and on. */
  | { kind: "live"; span: Span }
  | { kind: "own"; from: number; to: number };

/** The range that a query names; the usual one if it is wrong or missing. */
export function rangeOf(query: URLSearchParams, zone: string, usual: Span = "15m"): Range {
  const own = ownOf(query.get("from"), query.get("to"), zone);
  if (own !== null) return own;
  const named = query.get("span") ?? "";
  return { kind: "live", span: Object.hasOwn(SPANS, named) ? (named as Span) : usual };
}

/**
 * A range of one's own; `null` if a time is wrong, the end is not behind the begin, or the range is too
 * long.
 */
export function ownOf(from: string | null, to: string | null, zone: string): Extract<Range, { kind: "own" }> | null {
  const [begin, end] = [from, to].map((text) => (text === null ? null : instantOf(text, zone)));
  if (begin == null || end == null || begin >= end || end - begin > LONGEST) return null;
  return { kind: "own", from: begin, to: end };
}

/** Its instants, if it is `now`. */
export function limits(range: Range, now: number): { from: number; to: number } {
  return range.kind === "own" ? { from: range.from, to: range.to } : { from: now - SPANS[range.span], to: now };
}

/** The parts of a query that name a range. */
export function queryOf(range: Range, zone: string): { span: string; from: string; to: string } {
  if (range.kind === "live") return { span: range.span, from: "", to: "" };
  return { span: "", from: wall(range.from, zone), to: wall(range.to, zone) };
}
