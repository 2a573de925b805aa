/** Reads the messages of `/v1/live`. */
import type { LiveSent } from "../api/types.ts";

const KNOWN = new Set([
  "reset",
  "snapshot",
  "change",
  "removed",
  "event",
  "events_lost",
  "alive",
  "subscribed",
  "problem",
]);

/** A message; `null` for one that this page does not know, which a newer gateway may send. */
export function decode(text: string): LiveSent | null {
  let read: unknown;
  try {
    read = JSON.parse(text);
  } catch {
    return null;
  }
  if (typeof read !== "object" || read === null || !("type" in read)) return null;
  return KNOWN.has(String(read.type)) ? (read as LiveSent) : null;
}
