/** The settings of the hall while somebody changes them. What the gateway alone can judge, it judges. */
import type { HallSettings, Settings, Weekday } from "../../api/types.ts";

type Shift = Settings["shifts"][number];

export const DAYS: readonly Weekday[] = ["mon", "tue", "wed", "thu", "fri", "sat", "sun"];
export const MAX_SHIFTS = 12;

export interface DraftShift {
  /** Tells the rows apart; it is not sent. */
  id: number;
  name: string;
  days: Weekday[];
  begin: string;
  end: string;
}

export interface Draft {
  zone: string;
  shifts: DraftShift[];
}

export interface Wrong {
  name: "badName" | "sameName" | null;
  days: "noDay" | null;
  begin: "badTime" | null;
  end: "badTime" | null;
}

export function draftOf({ time_zone, shifts }: Settings): Draft {
  return { zone: time_zone, shifts: shifts.map((shift, id) => ({ id, ...shift, days: [...shift.days] })) };
}

/** A shift without a name, on workdays. */
export function newShift(draft: Draft): DraftShift {
  const id = Math.max(-1, ...draft.shifts.map((shift) => shift.id)) + 1;
  return { id, name: "", days: DAYS.slice(0, 5), begin: "06:00", end: "14:00" };
}

export function wantedOf({ zone, shifts }: Draft): HallSettings {
  const wanted = shifts.map(
    ({ name, days, begin, end }): Shift => ({ name, days: DAYS.filter((day) => days.includes(day)), begin, end }),
  );
  return { time_zone: zone.trim(), shifts: wanted };
}

/** What is wrong with a shift. Overlaps are told by the gateway. */
export function wrongWith(shift: DraftShift, draft: Draft): Wrong {
  const isTime = (text: string): boolean => /^([01]\d|2[0-3]):[0-5]\d$/.test(text);
  const isTaken = draft.shifts.some((other) => other.id !== shift.id && other.name === shift.name);
  return {
    name: !/^[a-z0-9-]{1,32}$/.test(shift.name) ? "badName" : isTaken ? "sameName" : null,
    days: shift.days.length === 0 ? "noDay" : null,
    begin: isTime(shift.begin) ? null : "badTime",
    end: isTime(shift.end) || shift.end === "24:00" ? null : "badTime",
  };
}

export function isSound(draft: Draft): boolean {
  return (
    draft.zone.trim() !== "" &&
    draft.shifts.every((shift) => Object.values(wrongWith(shift, draft)).every((wrong) => wrong === null))
  );
}

/** Whether something in it is not as the gateway has it. */
export function isChanged(draft: Draft, settings: Settings): boolean {
  return JSON.stringify(wantedOf(draft)) !== JSON.stringify(wantedOf(draftOf(settings)));
}

/** The time of day in a zone; `null` if this browser does not know the zone. */
export function timeIn(zone: string, at: number): string | null {
  try {
    return new Date(at).toLocaleString("sv-SE", { timeZone: zone.trim(), dateStyle: "short", timeStyle: "short" });
  } catch {
    return null;
  }
}
