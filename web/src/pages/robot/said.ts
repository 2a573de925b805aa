/** What was done to a robot, in words, with times of the hall. */
import { clock } from "../../i18n/format.ts";
import type { en } from "../../i18n/en.ts";
import type { SpeedSet } from "../../robots/deeds.ts";
import { hall } from "../../state/hall.svelte.ts";

export function timeOf(at: number): string {
  return clock(at, hall.zone, hall.time(hall.now()));
}

/** The global speed as far as it is known; `null` if nothing is. */
export function speedText(speed: SpeedSet | null, words: typeof en): string | null {
  if (speed === null) return null;
  const say = speed.outcome === "accepted" ? words.controls.speedSet : words.controls.speedMaybe;
  return say(speed.percent, speed.by, timeOf(speed.at));
}
