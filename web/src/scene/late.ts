/**
 * Positions of axes between two readings. The picture is one reading late: from the moment a reading comes,
 * it goes from the last reading to that one, and stays there. It never goes further than what was read.
 */

/** Readings further apart than this, in milliseconds, are not joined: the picture jumps. */
const APART = 1_000;

export class Late {
  #from: readonly number[] | null = null;
  #to: readonly number[] | null = null;
  #begun = 0;
  #lasts = 0;

  /**
   * Takes in a reading that came at `now`; `null` if the positions are not known. `period`: how often one
   * comes.
   */
  read(axes: readonly number[] | null, now: number, period: number): void {
    const shown = this.at(now);
    const since = Math.max(now - this.#begun, 1);
    // Without a change for two periods the arm stood until a period ago.
    this.#lasts = axes === null || shown === null || period > APART ? 0 : since < period * 2 ? since : period;
    this.#from = shown;
    this.#to = axes;
    this.#begun = now;
  }

  /** What to show at this time; `null` if it is not known. */
  at(now: number): readonly number[] | null {
    const [from, to] = [this.#from, this.#to];
    if (to === null || from === null || this.isAt(now)) return to;
    const part = Math.max(0, (now - this.#begun) / this.#lasts);
    return to.map((end, axis) => {
      const begin = from[axis] ?? end;
      return begin + (end - begin) * part;
    });
  }

  /** Whether the last reading is shown as it is. */
  isAt(now: number): boolean {
    return now - this.#begun >= this.#lasts;
  }
}
