/**
 * Moves one axis of a virtual robot as long as a button is held. The virtual controller stops the axis 200 ms after it
 * last heard that the button is held. So a page that stalls, is hidden or has lost the gateway moves nothing for longer.
 * No clock, timer or document: they come from outside, for tests.
 */

/**
 * How often the controller is told, in milliseconds, counted from question to question: three times within its 200 ms,
 * so that one late answer does not stop the arm.
 */
export const EVERY = 60;

export interface JogWorld {
  now(): number;
  /** Waits for so many milliseconds. */
  wait(ms: number): Promise<void>;
  /** Begins the move. Returns whether it moves. */
  begin(axis: string, up: boolean): Promise<boolean>;
  /** Tells that the button is still held. Returns whether it still moves. */
  keep(): Promise<boolean>;
  /** The button is let go. */
  end(): void;
  /** Which axis moves, or none. */
  moves(what: { axis: string; up: boolean } | null): void;
}

export class Jog {
  /** Counts the presses: what belongs to an earlier one does nothing any more. */
  private press = 0;
  private isHeld = false;
  /** Whether the first request is still under way: the end has to come behind it. */
  private isBeginning = false;

  constructor(private readonly world: JogWorld) {}

  /** Whether a button is held. */
  get isOn(): boolean {
    return this.isHeld;
  }

  /** The button is pressed. Another one that is held counts, and this one does not. */
  async hold(axis: string, up: boolean): Promise<void> {
    if (this.isHeld || this.isBeginning) return;
    this.isHeld = true;
    this.isBeginning = true;
    const press = ++this.press;
    const isMine = (): boolean => this.isHeld && this.press === press;
    this.world.moves({ axis, up });
    let asked = this.world.now();
    let goesOn = await this.world.begin(axis, up);
    this.isBeginning = false;
    if (!isMine()) {
      this.world.end();
      return;
    }
    while (goesOn) {
      await this.world.wait(Math.max(0, EVERY - (this.world.now() - asked)));
      if (!isMine()) return;
      asked = this.world.now();
      goesOn = await this.world.keep();
      if (!isMine()) return;
    }
    // The controller has ended the move: at a limit, by a stop, or because a request came too late.
    this.isHeld = false;
    this.world.moves(null);
  }

  /** The button is let go, or may not be held any more. */
  release(): void {
    if (!this.isHeld) return;
    this.isHeld = false;
    this.world.moves(null);
    if (!this.isBeginning) this.world.end();
  }
}
