/** Passwords: what the gateway takes, and new ones. */

const LEAST = 12;
const MOST = 128;

export function isPassword(text: string): boolean {
  const length = [...text].length;
  return length >= LEAST && length <= MOST;
}

/** Characters that are not mistaken for others when they are read from a note. */
const CLEAR = "abcdefghijkmnpqrstuvwxyz23456789";

/** A password of 100 random bits, in groups: `k3mv7-…`. */
export function newPassword(random: (bytes: Uint8Array) => Uint8Array): string {
  const drawn = [...random(new Uint8Array(20))].map((byte) => CLEAR[byte % CLEAR.length] ?? "");
  return [0, 5, 10, 15].map((at) => drawn.slice(at, at + 5).join("")).join("-");
}

/** Names that the audit log uses for others. */
const TAKEN = ["gateway", "shell", "raw", "link"];

export function isUserName(text: string): boolean {
  return /^[a-z][a-z0-9._-]{0,63}$/.test(text) && !TAKEN.includes(text);
}
