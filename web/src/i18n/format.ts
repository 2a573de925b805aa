/** Times and numbers. Times are those of the hall, wherever the browser is. */

import { dayOf, wall } from "./zone.ts";

/** The time of day in a time zone, `10:42:03`; with the date if it is another day than `now`. */
export function clock(millis: number, zone: string, now: number): string {
  const [day = "", time = ""] = wall(millis, zone).split("T");
  return day === dayOf(now, zone) ? time : `${day} ${time}`;
}

/** `4:32` */
export function minutes(millis: number): string {
  const seconds = Math.max(0, Math.ceil(millis / 1000));
  return `${Math.floor(seconds / 60)}:${String(seconds % 60).padStart(2, "0")}`;
}
