/** The secret behind the `#` of the page's address. */

/** What signs in: a token, or the secret of a link, which opens sessions and is no token. */
export type Secret = { token: string } | { secret: string };

/**
 * Reads a token as `r6 gateway token` shows it, or the secret of the link of `r6 up`: 256 bits as base64url, which
 * the gateway knows in hexadecimal. Returns `null` if the text is neither.
 */
export function secretOf(text: string): Secret | null {
  const plain = text.trim();
  if (/^r6_[0-9a-f]{64}$/.test(plain)) return { token: plain };
  if (!/^[A-Za-z0-9_-]{43}$/.test(plain)) return null;
  const bytes = atob(plain.replaceAll("-", "+").replaceAll("_", "/") + "=");
  const hex = Array.from(bytes, (byte) => byte.charCodeAt(0).toString(16).padStart(2, "0"));
  return { secret: hex.join("") };
}

/** A one-time link: it makes the first admin, or sets the password of the user with this name. */
export interface OneTimeLink {
  secret: string;
  name: string | null;
}

/** Reads what the page of one-time links hands on: `link=SECRET`, or `link=SECRET&NAME`. `null` for another text. */
export function oneTimeLinkOf(text: string): OneTimeLink | null {
  const [, secret, name] = /^link=([^&]+)(?:&(.+))?$/.exec(text) ?? [];
  return secret === undefined ? null : { secret, name: name ?? null };
}
