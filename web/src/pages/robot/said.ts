/** The speed of a robot in words, with times of the hall. */
import type { en } from "../../i18n/en.ts";
import type { RobotSummary } from "../../api/types.ts";
import { hall } from "../../state/hall.svelte.ts";

export function timeOf(at: number): string {
  return hall.clock(at);
}

/**
 * The global speed as it was last set, and of a virtual robot as its panel says. `null` if it is not known.
 * `ofPanel`: what the panel says; `null` without one.
 */
export function speedText({ global_speed: set }: RobotSummary, ofPanel: number | null, words: typeof en): string | null {
  if (set === null) return ofPanel === null ? null : words.controls.speedOfPanel(ofPanel);
  const [by, at] = [set.by, timeOf(Date.parse(set.at))];
  if (ofPanel === null) return words.controls.speedSet(set.percent, by, at);
  return ofPanel === set.percent ? words.controls.speedOfPanelSet(ofPanel, by, at) : words.controls.speedOfPanel(ofPanel);
}
