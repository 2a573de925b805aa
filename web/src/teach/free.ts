/** The first of `P1`, `P2` and so on that is not taken, for the prefix `P`. */
export function firstFreeName(prefix: string, taken: readonly string[]): string {
  const names = new Set(taken);
  for (let number = 1; ; number += 1) if (!names.has(`${prefix}${number}`)) return `${prefix}${number}`;
}
