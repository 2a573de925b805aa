import { expect, test } from "vitest";
import { beginOf, dayAfter, dayOf, instantOf, isKnown, wall } from "./zone.ts";

const BERLIN = "Europe/Berlin";
const HOUR = 3_600_000;

test("a time on the wall of the hall is an instant, wherever the browser is", () => {
  expect(instantOf("2026-11-25T06:00", "UTC")).toBe(Date.parse("2026-11-25T06:00:00Z"));
  expect(instantOf("2026-11-25T06:00", BERLIN)).toBe(Date.parse("2026-11-25T05:00:00Z"));
  expect(instantOf("2026-07-25T06:00:30", BERLIN)).toBe(Date.parse("2026-07-25T04:00:30Z"));
  expect(instantOf("2026-11-25T06:00", "Asia/Shanghai")).toBe(Date.parse("2026-11-24T22:00:00Z"));
  expect(instantOf("2026-11-25T06:00", "America/Los_Angeles")).toBe(Date.parse("2026-11-25T14:00:00Z"));
  for (const text of ["", "today", "2026-11-25", "2026-13-25T06:00", "2026-11-25T06:00Z"]) expect(instantOf(text, BERLIN)).toBeNull();
});

test("where the clocks change, a time that comes twice means the first, and a time that is left out means the change", () => {
  const autumn = Date.parse("2026-10-25T00:30:00Z");
  expect([wall(autumn, BERLIN), wall(autumn + HOUR, BERLIN)]).toEqual(["2026-10-25T02:30:00", "2026-10-25T02:30:00"]);
  expect(instantOf("2026-10-25T02:30", BERLIN)).toBe(autumn);
  expect(instantOf("2026-03-29T02:30", BERLIN)).toBe(Date.parse("2026-03-29T01:00:00Z"));
  // The day of the change has 23 or 25 hours.
  const length = (day: string): number => (beginOf(dayAfter(day, 1), BERLIN)! - beginOf(day, BERLIN)!) / HOUR;
  expect(["2026-03-29", "2026-10-25", "2026-11-25"].map(length)).toEqual([23, 25, 24]);
});

test("a day is one of the hall", () => {
  const late = Date.parse("2026-11-25T23:30:00Z");
  expect([dayOf(late, "UTC"), dayOf(late, BERLIN), dayOf(late, "America/New_York")]).toEqual(["2026-11-25", "2026-11-26", "2026-11-25"]);
  expect([dayAfter("2026-11-30", 1), dayAfter("2026-03-01", -1), dayAfter("2026-01-01", -1)]).toEqual([
    "2026-12-01",
    "2026-02-28",
    "2025-12-31",
  ]);
});

test("times of a zone that the browser does not know are in UTC", () => {
  const at = Date.parse("2026-11-25T23:30:05Z");
  expect(["Etc/Unknown", "Mars/Olympus", "", BERLIN].map(isKnown)).toEqual([false, false, false, true]);
  expect(wall(at, "Etc/Unknown")).toBe("2026-11-25T23:30:05");
  expect([dayOf(at, "Etc/Unknown"), instantOf("2026-11-25T23:30:05", "Etc/Unknown")]).toEqual(["2026-11-25", at]);
});
