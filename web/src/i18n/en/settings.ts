/** Words of the page of settings. */
import type { Weekday } from "../../api/types.ts";

const DAYS: Record<Weekday, string> = { mon: "Mon", tue: "Tue", wed: "Wed", thu: "Thu", fri: "Fri", sat: "Sat", sun: "Sun" };

export const hallSettings = {
  hall: "Time zone and shifts of the hall",
  byFile: "The file of the gateway has these. Change them there, and have the gateway read it again (SIGHUP).",
  needsAdmin: "An admin of all robots changes these.",
  zone: "Time zone",
  zoneHint: "A name of the IANA database, such as Europe/Berlin or Asia/Shanghai. All times of the dashboard are in it.",
  zoneUnknown: "This browser does not know the zone. The gateway may know it.",
  now: (at: string) => `There it is ${at} now.`,
  shifts: "Shifts",
  noShift: "No shift. Production is then shown by the day only.",
  shift: "Name",
  shiftHint: "a to z, digits and -",
  days: "Begins on",
  day: (day: Weekday) => DAYS[day],
  begin: "Begin",
  end: "End",
  timeHint: "06:00; 24:00 is the end of the day",
  addShift: "Add a shift",
  removeShift: (name: string) => `Remove shift ${name}`,
  remove: "Remove",
  badName: "1 to 32 characters: a to z, digits and -.",
  sameName: "Another shift has this name.",
  badTime: "A time such as 06:00.",
  noDay: "Choose a day.",
  fix: "Something above is not allowed.",
  changes: "What was before the change is counted with the new shifts from then on.",
  did: "Change the settings of the hall",
  reset: "Undo my changes",
  browser: "This browser",
  browserWhat: "These are kept in this browser only.",
  gateway: "The gateway",
  address: "Address",
  version: "Version",
};
