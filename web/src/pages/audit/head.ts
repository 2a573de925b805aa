/** Heads of the audit log that were kept. */

/** Number and hash in the text of a head, as `GET /v1/audit/head` tells it; `null` for another text. */
export function headIn(text: string): { number: number; hash: string } | null {
  try {
    const read: unknown = JSON.parse(text);
    if (typeof read !== "object" || read === null || !("number" in read) || !("hash" in read)) return null;
    const { number, hash } = read;
    const isHead = typeof number === "number" && Number.isSafeInteger(number) && number > 0 && typeof hash === "string";
    return isHead ? { number, hash } : null;
  } catch {
    return null;
  }
}
