/** Numbers and spans of time in English. */

const rules = new Intl.PluralRules("en");

/** `1 robot`, `2 robots` */
export function count(number: number, one: string, other: string): string {
  return `${number} ${rules.select(number) === "one" ? one : other}`;
}

/** A time span for people: `12 s`, `2 min 13 s`, `3 h 5 min`. */
export function duration(seconds: number): string {
  const whole = Math.max(0, Math.floor(seconds));
  if (whole < 60) return `${whole} s`;
  if (whole < 3600) return `${Math.floor(whole / 60)} min ${whole % 60} s`;
  return `${Math.floor(whole / 3600)} h ${Math.floor((whole % 3600) / 60)} min`;
}

/** Seconds with a decimal: a program of 5.28 s is not one of 5 s. */
export function seconds(ms: number): string {
  return ms < 60_000 ? `${(ms / 1000).toFixed(2)} s` : duration(ms / 1000);
}
