/** Where an alarm lies on a time line. Pure. */
import type { RobotAlarm } from "../../api/types.ts";

/** Its begin and end as parts of the time line, from 0 to 1. `end` and `length` are milliseconds. */
export function spanOf(alarm: RobotAlarm, end: number, length: number): [number, number] {
  const part = (at: number): number => Math.min(1, Math.max(0, (at - (end - length)) / length));
  return [part(Date.parse(alarm.since)), alarm.until === null ? 1 : part(Date.parse(alarm.until))];
}
