/** The time zone of the hall, which an admin may change while pages are open. */

/** How long a question that had no answer waits to be asked again before the zone is known, in milliseconds. */
const AGAIN = 2_000;
/** How often it is asked whether it is another one, in milliseconds: no event tells it. */
const LOOK = 60_000;

export interface World {
  /** The zone as the gateway has it now; `null` without an answer. */
  read(): Promise<string | null>;
  /** Calls `act` once after so many milliseconds. Returns what cancels it. */
  after(ms: number, act: () => void): () => void;
  /** Whether somebody uses the page. Each question keeps the session open. */
  readonly isUsed: boolean;
}

/** Tells the zone when it is known, and what it is later; before, `null` for each question without an answer. Returns what ends it. */
export function followZone(world: World, tell: (zone: string | null) => void): () => void {
  let [isKnown, isOver] = [false, false];
  let cancel = (): void => {};
  const ask = async (): Promise<void> => {
    const zone = !isKnown || world.isUsed ? await world.read() : null;
    if (isOver) return;
    if (zone !== null || !isKnown) tell(zone);
    isKnown ||= zone !== null;
    cancel = world.after(isKnown ? LOOK : AGAIN, () => void ask());
  };
  void ask();
  return () => {
    isOver = true;
    cancel();
  };
}
