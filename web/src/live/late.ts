/**
 * Bounds how late the messages of the stream are. A slow network hands them on late and in order, so that the page
 * cannot see it from the messages alone. But they carry the gateway's time, and what the gateway's clock shows is known
 * from its answers to questions of the page: an answer was written after the question left, and before it came. Pure:
 * times are those of the page's clock, in milliseconds, where nothing else is said.
 */

/** A question without an answer for so long: the gateway or the network is slow. It is less than `QUIET` in `socket.ts`. */
export const ANSWER = 3_000;
/** What an answer said counts for so long. Clocks are set, and do not go alike. */
const KEPT = 60_000;
/** The header `Date` has whole seconds. */
const SECOND = 1_000;
/** So much earlier than it left a message may seem to come: clocks are read in steps. */
const STEP = 100;

export class Late {
  /** By how much the gateway's clock is ahead of the page's at most, from each answer. */
  private bounds: { at: number; most: number }[] = [];

  /** Takes in an answer: when the question left, when the answer came, and its header `Date`, since 1970. */
  answered(sent: number, came: number, date: number): void {
    const least = date - came;
    // The gateway's clock was set if an earlier bound contradicts this answer.
    this.bounds = this.bounds.filter(({ at, most }) => came - at <= KEPT && most >= least);
    this.bounds.push({ at: came, most: date + SECOND - sent });
  }

  /** When a message that carries this time of the gateway, since 1970, left it at the earliest; `null` if that is not known. */
  left(time: number, now: number): number | null {
    this.bounds = this.bounds.filter(({ at }) => now - at <= KEPT);
    if (this.bounds.length === 0) return null;
    const left = time - Math.min(...this.bounds.map(({ most }) => most));
    if (left <= now + STEP) return Math.min(left, now);
    // It cannot leave after it came: one of the clocks was set, or stood still.
    this.forget();
    return null;
  }

  /** One of the clocks was set, or stood still. */
  forget(): void {
    this.bounds = [];
  }
}
