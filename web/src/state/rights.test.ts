import { expect, test } from "vitest";
import { covers, namesOf } from "./rights.ts";

test("a token for some robots is for these alone", () => {
  const robots = ["press", "saw", "press,saw", "", null];
  expect(robots.map((robot) => covers("press,saw", robot))).toEqual([true, true, false, false, false]);
  expect(robots.map((robot) => covers("saw", robot))).toEqual([false, true, false, false, false]);
  expect(robots.map((robot) => covers("", robot))).toEqual([false, false, false, false, false]);
  expect(robots.map((robot) => covers(null, robot))).toEqual([true, true, true, true, true]);
  expect([namesOf(null), namesOf(""), namesOf("saw"), namesOf("press,saw")]).toEqual([[], [], ["saw"], ["press", "saw"]]);
});
