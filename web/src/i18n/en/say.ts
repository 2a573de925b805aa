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
