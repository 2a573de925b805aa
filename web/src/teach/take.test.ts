import { expect, test } from "vitest";
import type { Queried, Signal } from "../api/types.ts";
import { addresses, pointOf } from "./take.ts";

function answer(values: Record<string, Signal["value"]>, quality: Signal["quality"] = "fresh"): Queried {
  const signals = Object.entries(values).map(
    ([address, value]): Signal => ({ address, value, unit: null, quality: value === null ? "none" : quality, age_ms: value === null ? null : 5 }),
  );
  return { signals, problems: [] };
}

const POSE = Object.fromEntries([360.0004, -50, 500, 180, 0, -180].map((value, at) => [`world-${at}`, value]));

test("a standing arm gives a point with axes and pose, as exact as the wire", () => {
  const read = answer({ isMoving: false, "axis-0": 10.00049, "axis-1": -0.0001, "axis-2": null, ...POSE });
  expect(pointOf(read, 2)).toEqual({ axes: [10, 0], pose: [360, -50, 500, 180, 0, -180] });
  expect(pointOf(read, null)).toMatchObject({ axes: [10, 0] });
  expect(pointOf(answer({ isMoving: false, "axis-0": 1, "world-0": 1 }), 1)).toEqual({ axes: [1], pose: null });
  expect(addresses().split(",").length).toBe(15);
});

test("what is old, missing or moving is no point", () => {
  expect(pointOf(answer({ isMoving: true, "axis-0": 1 }), 1)).toEqual({ not: "moving" });
  expect(pointOf(answer({ isMoving: null, "axis-0": 1 }), 1)).toEqual({ not: "moving_unknown" });
  expect(pointOf(answer({ "axis-0": 1 }), 1)).toEqual({ not: "moving_unknown" });
  expect(pointOf(answer({ isMoving: false, "axis-0": 1 }, "stale"), 1)).toEqual({ not: "moving_unknown" });
  const old = answer({ isMoving: false });
  old.signals.push({ address: "axis-0", value: 1, unit: null, quality: "stale", age_ms: 9_000 });
  expect(pointOf(old, 1)).toEqual({ not: "not_fresh" });
  expect(pointOf(answer({ isMoving: false, "axis-0": 1, "axis-1": null }), 2)).toEqual({ not: "no_axes" });
  expect(pointOf(answer({ isMoving: false }), null)).toEqual({ not: "no_axes" });
});
