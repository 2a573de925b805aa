/** What the guard of a robot limits, in lines. Pure. */
import type { GuardRange, RobotGuard } from "../../api/types.ts";
import type { arm } from "../../i18n/en/arm.ts";

export function limitsOf(guard: RobotGuard, words: typeof arm.limits): string[] {
  const most = (limit: number | null, line: (limit: number) => string): string[] => (limit === null ? [] : [line(limit)]);
  const range = ({ of, unit, lowest, highest }: GuardRange): string =>
    words.range(of.toUpperCase(), lowest, highest, unit === "deg" ? "°" : unit);
  return [
    ...guard.workspace.map(range),
    ...guard.axes.map(range),
    ...most(guard.max_speed, words.speed),
    ...most(guard.max_path_speed, words.pathSpeed),
    ...most(guard.max_axis_step, words.axisStep),
    ...most(guard.max_distance, words.distance),
  ];
}
