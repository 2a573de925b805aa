import { expect, test } from "vitest";
import type { Settings } from "../../api/types.ts";
import { draftOf, isChanged, isSound, newShift, timeIn, wantedOf, wrongWith } from "./draft.ts";

const SETTINGS: Settings = {
  time_zone: "Europe/Berlin",
  shifts: [{ name: "early", days: ["mon", "tue"], begin: "06:00", end: "14:00" }],
  managed_by: "api",
  etag: '"1-a"',
};

test("a draft begins as the settings are, and knows when it is another one", () => {
  const draft = draftOf(SETTINGS);
  expect(isChanged(draft, SETTINGS)).toBe(false);
  draft.shifts.push({ ...newShift(draft), name: "late" });
  expect(isChanged(draft, SETTINGS)).toBe(true);
  expect(wantedOf(draft).shifts?.[1]).toEqual({ name: "late", days: ["mon", "tue", "wed", "thu", "fri"], begin: "06:00", end: "14:00" });
  expect(SETTINGS.shifts.length, "the settings stay as they are").toBe(1);
});

test("the order in which days were chosen does not matter", () => {
  const draft = draftOf(SETTINGS);
  draft.shifts[0]!.days = ["tue", "mon"];
  expect(isChanged(draft, SETTINGS)).toBe(false);
});

test("what is wrong is said beside it", () => {
  const draft = draftOf(SETTINGS);
  const shift = { ...newShift(draft), name: "early", days: [], begin: "6:00", end: "24:00" };
  draft.shifts.push(shift);
  expect(wrongWith(shift, draft)).toEqual({ name: "sameName", days: "noDay", begin: "badTime", end: null });
  expect(wrongWith({ ...shift, name: "Early", begin: "24:00", end: "25:00" }, draft)).toMatchObject({ name: "badName", begin: "badTime", end: "badTime" });
  expect(isSound(draft)).toBe(false);
  expect(isSound(draftOf(SETTINGS))).toBe(true);
});

test("the time in a zone, and zones that the browser does not know", () => {
  expect(timeIn("Asia/Shanghai", Date.parse("2026-11-25T06:00:00Z"))).toBe("2026-11-25 14:00");
  expect(timeIn("Mars/Olympus", 0)).toBeNull();
});
