/** The speed of a robot in words, with times of the hall. */
import { clock } from "../../i18n/format.ts";
import type { en } from "../../i18n/en.ts";
import type { RobotSummary } from "../../api/types.ts";
import { hall } from "../../state/hall.svelte.ts";

export function timeOf(at: number): string {
  return clock(at, hall.zone, hall.time(hall.now()));
}

/** The global speed as it was last set; `null` if that is not known. */
export function speedText({ global_speed: set }: RobotSummary, words: typeof en): string | null {
  return set === null ? null : words.controls.speedSet(set.percent, set.by, timeOf(Date.parse(set.at)));
}
