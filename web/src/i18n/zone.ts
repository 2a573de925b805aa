/** Instants and the clock on the wall of the hall. An instant is milliseconds since 1970. */

/** To make one takes longer than to use it many times. `null`: this browser does not know the zone. */
const formats = new Map<string, Intl.DateTimeFormat | null>();

function formatOf(zone: string): Intl.DateTimeFormat | null {
  const known = formats.get(zone);
  if (known !== undefined) return known;
  const digits = { year: "numeric", month: "2-digit", day: "2-digit", hour: "2-digit", minute: "2-digit", second: "2-digit" } as const;
  let format: Intl.DateTimeFormat | null = null;
  try {
    format = new Intl.DateTimeFormat("sv-SE", { timeZone: zone, ...digits });
  } catch {
    // The tables of the gateway are newer, or its file has a name that browsers leave out.
  }
  formats.set(zone, format);
  return format;
}

/** Whether this browser knows a zone. Times of one that it does not know are in UTC, and the page has to say so. */
export function isKnown(zone: string): boolean {
  return formatOf(zone) !== null;
}

/** The zone in which times are shown. */
export function shownZone(zone: string): string {
  return isKnown(zone) ? zone : "UTC";
}

/** A time of the clock on the wall, with its day: `2026-11-25T06:00:00`. */
export function wall(instant: number, zone: string): string {
  const format = formatOf(zone) ?? formatOf("UTC");
  return format === null ? new Date(instant).toISOString().slice(0, 19) : format.format(instant).replace(" ", "T");
}

/** The day on the calendar of the hall: `2026-11-25`. */
export function dayOf(instant: number, zone: string): string {
  return wall(instant, zone).slice(0, 10);
}

/**
 * The instant of a time on the wall, `2026-11-25T06:00` or with seconds; `null` if it is no time. A time that
 * comes twice is the first one. A time that a change of the clock leaves out is the moment of the change.
 */
export function instantOf(text: string, zone: string): number | null {
  const full = /T\d\d:\d\d$/.test(text) ? `${text}:00` : text;
  if (!/^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d$/.test(full)) return null;
  const utc = Date.parse(`${full}Z`);
  if (Number.isNaN(utc)) return null;
  // No zone is more than 14 h from UTC. The text of the wall only grows but for an hour or so at a change.
  const offset = (at: number): number => Date.parse(`${wall(at, zone)}Z`) - Math.floor(at / 1000) * 1000;
  const offsets = [utc - 86_400_000, utc + 86_400_000].map(offset);
  const found = offsets.map((by) => utc - by).filter((at) => wall(at, zone) === full);
  if (found.length > 0) return Math.min(...found);
  return changeIn(utc - Math.max(...offsets), utc - Math.min(...offsets), offset);
}

/** The begin of a day of the hall; `null` if it is no day. */
export function beginOf(day: string, zone: string): number | null {
  return instantOf(`${day}T00:00:00`, zone);
}

/** The day that is `days` days later; earlier if `days` is negative. */
export function dayAfter(day: string, days: number): string {
  const at = new Date(`${day}T00:00:00Z`);
  at.setUTCDate(at.getUTCDate() + days);
  return at.toISOString().slice(0, 10);
}

/** When the clock on the wall is set in a span, to the second. */
function changeIn(from: number, to: number, offset: (at: number) => number): number {
  let [low, high] = [Math.floor(from / 1000), Math.ceil(to / 1000)];
  const before = offset(low * 1000);
  while (high - low > 1) {
    const middle = Math.floor((low + high) / 2);
    if (offset(middle * 1000) === before) low = middle;
    else high = middle;
  }
  return high * 1000;
}
