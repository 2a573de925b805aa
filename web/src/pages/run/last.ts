/** The last look before a run is sent: no event tells these, so the page asks for them again. */
import type { Void } from "../../run/guard.ts";
import type { Order } from "./runner.svelte.ts";
import { framesOf } from "./seen.ts";
import { stored } from "./stored.ts";

/**
 * The person has held the button, and the arm is to move now: without the answers within this time, in milliseconds,
 * nothing is sent.
 */
const PATIENCE = 2_000;

/**
 * Why a prepared run may not be sent; `null` if it may. `frames`: tool and work frame as they were when it was
 * prepared. `not_read`: a question had no answer of now.
 */
export async function lastLook(
  robot: string,
  frames: string | null,
  { kept, text }: Order,
): Promise<(Void & ("version" | "frames")) | "not_read" | null> {
  const signal = AbortSignal.timeout(PATIENCE);
  const [is, now] = await Promise.all([kept === undefined ? "same" : stored(kept, text, signal), framesOf(robot, signal)]);
  if (is === "another") return "version";
  if (now !== undefined && now !== frames) return "frames";
  return is === "no_answer" || now === undefined ? "not_read" : null;
}
