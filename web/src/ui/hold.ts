/**
 * When a button acts that has to be held: no accident and no repeated key may do it. No clock, timer or
 * document: they come from outside, for tests.
 */

/** How long it has to be held, in milliseconds. */
export const HOLD = 1_000;
/** With keys it is pressed twice, within this time. */
export const AGAIN = 3_000;
/**
 * Between the two presses the key is up for so long, in milliseconds: keys bounce, and some remote desktops send the
 * repeats of one long press as presses.
 */
export const GAP = 300;
/** A press of a key counts once the button is there for so long, in milliseconds: what opened its dialog is none. */
export const SETTLE = 1_000;

export interface World {
  now(): number;
  /** Calls `act` once after so many milliseconds. Returns what cancels it. */
  after(ms: number, act: () => void): () => void;
  /** Whether a person has this page before them: it is visible and has the focus. */
  isAttended(): boolean;
  act(): void;
  /** The button is held, or is not any more. */
  held(isHeld: boolean): void;
  /** What a press that did not act lacks: to be held for longer, or another press of the key. `null`: nothing now. */
  lacks(what: Lack | null): void;
}

export type Lack = "longer" | "again";

export interface Pointer {
  pointerId: number;
  isPrimary: boolean;
  button: number;
}

export class Holding {
  private pointer: number | null = null;
  private cancel: () => void = () => {};
  private key: string | null = null;
  private keyDownAt = 0;
  /** The first press with a key, when it has ended. */
  private first: { down: number; up: number } | null = null;
  private unsay: () => void = () => {};
  /** Takes back what two presses are about to do. */
  private undo: () => void = () => {};
  private readonly born: number;

  constructor(private readonly world: World) {
    this.born = world.now();
  }

  down({ pointerId, isPrimary, button }: Pointer): void {
    if (!isPrimary || button !== 0 || this.pointer !== null) return;
    this.cancel();
    this.pointer = pointerId;
    this.say(null);
    this.world.held(true);
    this.cancel = this.world.after(HOLD, () => {
      if (this.pointer !== pointerId) return;
      this.drop();
      if (this.world.isAttended()) this.world.act();
    });
  }

  /** The pointer was lifted, left the button, or was lost. */
  up(pointerId: number): void {
    if (this.pointer !== pointerId) return;
    this.drop();
    this.say("longer");
  }

  /** `at`: when the key was pressed. A busy page hears of it later. */
  keyDown(key: string, isRepeat: boolean, at: number): void {
    if (isRepeat || this.key !== null) return;
    this.key = key;
    this.keyDownAt = at;
    this.press();
  }

  keyUp(key: string, at: number): void {
    if (this.key !== key) return;
    this.key = null;
    if (this.first !== null) this.first.up = at;
  }

  /** Another key, or one together with Ctrl and the like: what a scanner types, or a shortcut, is no press. */
  otherKey(): void {
    this.undo();
    this.first = null;
    this.say(null);
  }

  /** A press without a pointer or a key: by a tool of a person who can use neither. */
  click(at: number): void {
    if (this.key !== null) return;
    this.keyDownAt = at;
    this.press();
    if (this.first !== null) this.first.up = at;
  }

  /** Forgets what was begun: the page lost the focus, the button was switched off or is gone. */
  clear(): void {
    this.drop();
    this.undo();
    this.key = null;
    this.first = null;
    this.say(null);
  }

  private press(): void {
    const { first } = this;
    const now = this.keyDownAt;
    this.undo();
    if (now - this.born < SETTLE) return;
    if (first !== null && now - first.down < AGAIN && now - first.up >= GAP) {
      this.first = null;
      this.say(null);
      // Repeats that look like presses follow each other faster: then it was one long press.
      this.undo = this.world.after(GAP, () => {
        if (this.world.isAttended()) this.world.act();
      });
    } else {
      this.first = { down: now, up: Infinity };
      this.say("again");
    }
  }

  private say(what: Lack | null): void {
    this.unsay();
    this.world.lacks(what);
    // A second press of a key counts for as long as it is said.
    this.unsay = what === null ? () => {} : this.world.after(AGAIN, () => this.world.lacks(null));
  }

  private drop(): void {
    this.cancel();
    this.cancel = () => {};
    if (this.pointer === null) return;
    this.pointer = null;
    this.world.held(false);
  }
}
