/**
 * When a finger presses a stop in a list that scrolls: a scroll must stop no robot, and no press may be lost. No clock,
 * timer or document: they come from outside, for tests. Times are in milliseconds.
 */

/** It presses when it is lifted, or after it rested for so long. */
export const REST = 200;
/** It may be about to scroll once it has slid so far, in pixels: browsers take less for a tap. */
export const SLIDE = 12;
/** A list that was scrolled so short a time ago still runs: a short touch holds the list. */
export const RUNS = 150;

export interface World {
  /** Calls `act` once after so many milliseconds. Returns what cancels it. */
  after(ms: number, act: () => void): () => void;
  press(): void;
}

export interface Touch {
  pointerId: number;
  clientX: number;
  clientY: number;
  timeStamp: number;
}

export class Finger {
  private on: { id: number; x: number; y: number; isTap: boolean; hasSlid: boolean } | null = null;
  private unrest: () => void = () => {};
  private scrolledAt = -Infinity;

  constructor(private readonly world: World) {}

  /** The list was scrolled. */
  scrolled(at: number): void {
    this.scrolledAt = at;
  }

  down({ pointerId: id, clientX: x, clientY: y, timeStamp }: Touch): void {
    this.drop();
    const isTap = timeStamp - this.scrolledAt >= RUNS;
    this.on = { id, x, y, isTap, hasSlid: false };
    this.unrest = this.world.after(isTap ? REST : 2 * REST, () => {
      this.drop();
      this.world.press();
    });
  }

  move({ pointerId, clientY }: Touch): void {
    const { on } = this;
    // Sideways nothing scrolls.
    if (on?.id !== pointerId || Math.abs(clientY - on.y) <= SLIDE) return;
    on.hasSlid = true;
    this.unrest();
  }

  /** `isOver`: the finger is still over the button. */
  up({ pointerId }: Touch, isOver: boolean): void {
    if (this.on?.id !== pointerId) return;
    const { isTap } = this.on;
    this.drop();
    if (isTap && isOver) this.world.press();
  }

  /** The browser takes the finger for a scroll. If nothing scrolls by it, it was a press. */
  cancel({ pointerId, timeStamp }: Touch): void {
    if (this.on?.id !== pointerId) return;
    const { isTap } = this.on;
    this.drop();
    if (!isTap) return;
    this.world.after(REST, () => {
      if (this.scrolledAt < timeStamp - REST) this.world.press();
    });
  }

  /** The button goes away under the finger, as when its list is closed. Says whether that was a press by then. */
  leave(): boolean {
    const { on } = this;
    this.drop();
    return on !== null && on.isTap && !on.hasSlid;
  }

  /** What the finger began is forgotten. */
  drop(): void {
    this.unrest();
    this.unrest = () => {};
    this.on = null;
  }
}
