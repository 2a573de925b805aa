import { expect, test } from "vitest";
import { axesBy, beyondAxes } from "./axes.ts";
import { read } from "./document.ts";

const TEXT = `[[instruction]]
do = "axis-move"
to = [10, 0, -20, 5, 0, 0]
speed = 20

[[instruction]]
do = "axis-move"
to = [10, 0, -20, 5, 30, -1]
speed = 20

[[instruction]]
do = "axis-move"
to = [10, 0, -20, 5, 30, -1]
mask = "0x2F"
speed = 20

[[instruction]]
do = "linear-move"
to = [300, 0, 100, 180, 0, 180]
speed = 20
`;

test("a move of an axis that the robot lacks is found at its step; zeros and masked axes move nothing", () => {
  const result = read(TEXT);
  if ("wrong" in result) throw new Error("not read");
  expect([...beyondAxes(result.ok, 4)]).toEqual([
    [1, [4, 5]],
    [2, [5]],
  ]);
  expect([...beyondAxes(result.ok, 5)]).toEqual([
    [1, [5]],
    [2, [5]],
  ]);
  expect(beyondAxes(result.ok, 6).size).toBe(0);
  expect(beyondAxes(result.ok, null).size, "how many it has is not known").toBe(0);
});

test("a robot has as many axes as controller and model both have", () => {
  expect([axesBy(4, 6), axesBy(6, 4), axesBy(4, null), axesBy(null, 6), axesBy(0, undefined), axesBy(undefined, 0)]).toEqual([
    4, 4, 4, 6, null, null,
  ]);
});
