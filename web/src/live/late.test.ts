import { expect, test } from "vitest";
import { Late } from "./late.ts";

const EPOCH = Date.parse("2026-11-25T06:00:00Z");
/** The gateway's clock, which is `ahead` of the page's. */
const at = (page: number, ahead: number): number => EPOCH + ahead + page;
const seconds = (time: number): number => Math.floor(time / 1000) * 1000;

test("a message is as late as it can be by the gateway's clock, whatever the clocks show", () => {
  for (const ahead of [0, 250, 999, -86_400_000, 7_000_123]) {
    const late = new Late();
    expect(late.left(at(0, ahead), 0)).toBeNull();
    late.answered(1_000, 1_040, seconds(at(1_020, ahead)));
    for (const delay of [0, 500, 8_000]) {
      const left = late.left(at(5_000, ahead), 5_000 + delay)!;
      // Never later than it left, and no more than a second earlier.
      expect([left <= 5_000, left >= 5_000 - 1_040]).toEqual([true, true]);
    }
  }
});

test("more answers make it exact, and old ones do not count", () => {
  const late = new Late();
  for (let sent = 0; sent < 30_000; sent += 5_300) late.answered(sent, sent + 10, seconds(at(sent + 5, 420)));
  expect(late.left(at(30_000, 420), 38_000)).toBeGreaterThan(29_600);
  expect(late.left(at(90_000, 420), 90_000)).toBeNull();
});

test("a clock that was set is seen, and nothing is said until the next answer", () => {
  const late = new Late();
  late.answered(0, 10, seconds(at(5, 0)));
  // The page's computer slept an hour: its clock stood still.
  expect(late.left(at(3_600_000, 0), 2_000)).toBeNull();
  expect(late.left(at(2_000, 0), 2_000)).toBeNull();
  late.answered(2_000, 2_010, seconds(at(3_600_000, 0)));
  expect(late.left(at(3_601_000, 0), 3_000)).toBeGreaterThan(1_500);
  // An answer that an earlier one contradicts counts alone.
  late.answered(4_000, 4_010, seconds(at(9_000_000, 0)));
  expect(late.left(at(9_001_000, 0), 5_000)).toBeGreaterThan(3_500);
});
