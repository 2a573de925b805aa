import { expect, test } from "vitest";
import type { RobotGuard } from "../../api/types.ts";
import { arm } from "../../i18n/en/arm.ts";
import { limitsOf } from "./limits.ts";

const NONE: RobotGuard = { max_speed: null, max_path_speed: null, max_axis_step: null, max_distance: null, axes: [], workspace: [] };

test("each limit of a guard has a line, and what is not limited has none", () => {
  const guard: RobotGuard = {
    max_speed: 50,
    max_path_speed: 500,
    max_axis_step: 120,
    max_distance: 400,
    axes: [
      { of: "J1", unit: "deg", lowest: -120, highest: 120 },
      { of: "J7", unit: "mm", lowest: 0, highest: 1500 },
    ],
    workspace: [{ of: "z", unit: "mm", lowest: 100, highest: 900 }],
  };
  expect(limitsOf(guard, arm.limits)).toEqual([
    "Z: 100 to 900 mm",
    "J1: -120 to 120 °",
    "J7: 0 to 1500 mm",
    "Speed of a move: 50 % at most, before the global speed",
    "Path speed: 500 mm/s at most",
    "One axis move turns an axis by 120° at most",
    "One move of the tool goes 400 mm at most",
  ]);
  expect(limitsOf(NONE, arm.limits)).toEqual([]);
});
