import { expect, test } from "vitest";
import { viewLike } from "../../tests/view.ts";
import { Standing } from "./standing.ts";
import type { View } from "./view.ts";

test("an arm stands since it was first seen to, for as long as its program runs and it is seen", () => {
  const standing = new Standing();
  const rests = { mode: 7, moving: false } satisfies Partial<View>;
  const note = (now: number, part: Partial<View>, link: "up" | "down" = "up"): number | null => {
    standing.note(viewLike("saw", part, { link }), now);
    return standing.since("saw");
  };
  expect([note(1, rests), note(5, rests), standing.since("press")]).toEqual([1, 1, null]);
  const others: [Partial<View>, ("up" | "down")?][] = [
    [{ ...rests, moving: true }],
    [{ ...rests, moving: null }],
    [{ ...rests, mode: 2 }],
    [{ ...rests, quality: "stale" }],
    [rests, "down"],
  ];
  for (const [part, link] of others) {
    expect([note(10, part, link), note(20, rests)]).toEqual([null, 20]);
  }
  standing.clear();
  expect(standing.since("saw")).toBeNull();
});
