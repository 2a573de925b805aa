import { expect, test } from "vitest";
import type { RobotSummary } from "../../api/types.ts";
import { en } from "../../i18n/en.ts";
import { speedText } from "./said.ts";

const robot = (percent: number | null): RobotSummary => {
  const set = percent === null ? null : { percent, by: "token 3 (ann)", at: "2026-11-27T08:00:00Z" };
  return { global_speed: set } as RobotSummary;
};

test("a speed is told with who set it, and of a virtual robot only if its panel says the same", () => {
  expect(speedText(robot(null), null, en)).toBeNull();
  expect(speedText(robot(null), 30, en)).toBe(en.controls.speedOfPanel(30));
  expect(speedText(robot(20), null, en)).toMatch(/^20 %, set by token 3 \(ann\), .+; not reported by the controller$/);
  expect(speedText(robot(20), 20, en)).toMatch(/^20 %, set by token 3 \(ann\), .+; the panel of this virtual robot says the same$/);
  expect(speedText(robot(20), 50, en)).toBe(en.controls.speedOfPanel(50));
});
