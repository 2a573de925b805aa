/** Numbers that a person types in: `null` if the text cannot be sent as a number. */

/** Percent above 0 to 100, in the steps of 0.1 that the wire has. */
export function percentOf(text: string): number | null {
  if (!/^\d{1,3}([.,]\d)?$/.test(text.trim())) return null;
  const percent = Number(text.trim().replace(",", "."));
  return percent > 0 && percent <= 100 ? percent : null;
}

/** A number with at most three decimals, within these ends. */
export function numberOf(text: string, low: number, high: number): number | null {
  if (!/^\d{1,6}([.,]\d{1,3})?$/.test(text.trim())) return null;
  const number = Number(text.trim().replace(",", "."));
  return number >= low && number <= high ? number : null;
}

/** A whole number of 32 bits, within these ends. */
export function wholeOf(text: string, low = -2_147_483_648, high = 2_147_483_647): number | null {
  if (!/^-?\d{1,10}$/.test(text.trim())) return null;
  const number = Number(text.trim());
  return number >= low && number <= high ? number : null;
}

/** Whether a speed is to be asked about: it is higher than the last known one, or none is known. */
export function isRaise(from: number | null, to: number): boolean {
  return from === null || to > from;
}
