import { expect, test } from "vitest";
import type { ProgramPlan } from "../api/types.ts";
import { armAt, marksOf, nearLimits, stepAt, stepMarks } from "./preview.ts";
import { range } from "./scope.ts";

function sample(time_ms: number, axes: number[]): ProgramPlan["samples"][number] {
  return { time_ms, axes, axis_speeds: axes.map(() => 0), pose: [time_ms, 0, 0, 0, 0, 0], tool_speed: 0 };
}

function plan(part: Partial<ProgramPlan> = {}): ProgramPlan {
  const axis = (name: string, limits: number[]) => ({
    name,
    unit: "deg",
    lowest: 0,
    highest: 0,
    limits,
    top_speed: 0,
    full_speed: 100,
  });
  return {
    model: "M",
    kind: "instructions",
    ended: "done",
    duration_ms: 300,
    tool_path_mm: 10,
    axes: [axis("J1", [-100, 100]), axis("J2", [-10, 10])],
    steps: [
      { number: 1, text: "axis move", begin_ms: 0, end_ms: 100 },
      { number: 3, text: "axis move", begin_ms: 100, end_ms: 300 },
    ],
    problems: [],
    sample_ms: 100,
    samples: [sample(0, [0, 0]), sample(100, [10, 9.5]), sample(200, [96, 0]), sample(300, [0, -9.6])],
    remarks: [],
    ...part,
  };
}

const limit = { kind: "limit" as const, step: 3, at_ms: 250, axis: "J1", alarm: 135, message: "J1 above its limit" };

test("a path is amber near a limit, by the range of the axis", () => {
  expect(marksOf(plan())).toEqual(["ok", "near", "near", "near"]);
  expect(marksOf(plan({ samples: [sample(0, [93.9, 9.3])] }))).toEqual(["ok"]);
  const found = nearLimits(plan());
  expect(found.map(({ axis, value, limit, step }) => [axis, value, limit, step])).toEqual([
    ["J2", -9.6, -10, 3],
    ["J1", 96, 100, 3],
  ]);
  expect(found[0]?.room).toBeCloseTo(0.4);
});

test("where a plan ends at a limit or a singularity is marked, also if it ends at once", () => {
  const beyond = plan({ ended: "alarm", problems: [limit] });
  expect(marksOf(beyond)).toEqual(["ok", "near", "near", "beyond"]);
  expect([...stepMarks(beyond)]).toEqual([
    [3, "beyond"],
  ]);
  const at_once = plan({ samples: [sample(0, [0, 0])], problems: [{ ...limit, at_ms: 0, step: 1, kind: "singular" }] });
  expect([marksOf(at_once), [...stepMarks(at_once)]]).toEqual([["singular"], [[1, "singular"]]]);
  expect(marksOf(plan({ problems: [{ ...limit, kind: "waiting" }] })).at(-1)).toBe("near");
});

test("the arm is found at each instant, and is not told beyond the plan", () => {
  expect(armAt(plan(), 50)?.axes).toEqual([5, 4.75]);
  expect(armAt(plan(), 50)?.sample.time_ms).toBe(0);
  expect(armAt(plan(), 100)?.axes).toEqual([10, 9.5]);
  expect(armAt(plan(), 1e9)?.axes).toEqual([0, -9.6]);
  expect(armAt(plan(), -1)?.axes).toEqual([0, 0]);
  expect(armAt(plan({ samples: [] }), 0)).toBeNull();
  expect([stepAt(plan(), 99), stepAt(plan(), 100), stepAt(plan({ steps: [] }), 0)]).toEqual([1, 3, null]);
});

test("a scope names the steps that run", () => {
  expect([
    range({ kind: "all" }, 5),
    range({ kind: "from", step: 2 }, 5),
    range({ kind: "one", step: 4 }, 5),
    range({ kind: "one", step: 9 }, 5),
  ]).toEqual([
    [0, 5],
    [2, 5],
    [4, 5],
    [5, 5],
  ]);
});
