import { readFileSync } from "node:fs";
import { expect, test } from "vitest";
import type { ArmAxis, ArmGeometry, ArmModel } from "../api/types.ts";
import { Orbit } from "./camera.ts";
import { Late } from "./late.ts";
import { floorOf, geometric, linksOf, nearness, poseOf, rangeOf, spaceOf, stands, workspaceOf } from "./model.ts";
import { pathOf } from "./plan.ts";

/** A model as the gateway tells it, from the file that is compiled into the gateway. */
function model(name: string): ArmModel {
  const text = readFileSync(new URL(`../../../crates/r6-motion/models/${name}.toml`, import.meta.url), "utf8");
  const [head = "", ...axes] = text.split("[[axis]]");
  const kind = /^kind = "(.+)"/m.exec(head)?.[1]?.replace("-", "_");
  const lengths = [...(head.split("[geometry]")[1] ?? "").split("\n[")[0]!.matchAll(/^(\w+) = ([-\d.]+)/gm)];
  const all = { b: 0, tool_offset: 0, ...Object.fromEntries(lengths.map(([, key, value]) => [key, Number(value)])) };
  const number = (of: string, key: string, otherwise: number): number =>
    Number(new RegExp(`^${key} = ([-\\d.]+)`, "m").exec(of)?.[1] ?? otherwise);
  return {
    name,
    geometry: { kind, ...all } as unknown as ArmGeometry,
    axes: axes.map((part): ArmAxis => {
      const [, low, high] = /^soft = \[([-\d.]+), ([-\d.]+)\]/m.exec(part) ?? [];
      const sign = number(part, "sign", 1);
      const unit = /^lead/m.test(part) ? "mm" : "deg";
      const full_speed = number(part, "max_speed", 0);
      return { unit, limits: [Number(low), Number(high)], sign, offset: number(part, "offset", 0), full_speed };
    }),
    max_line_speed: 2000,
  };
}

/**
 * Axes and pose out of plans of `r6` (`POST /v1/programs/plan`, samples of an axis move), rounded to 0.001.
 */
const TOLD: [name: string, axes: number[], pose: number[]][] = [
  ["BRTIRUS0707A", [0, 0, 0, 0, 0, 0], [531.632, 0, 686.529, 180, 89.403, 180]],
  ["BRTIRUS0707A", [6.812, -4.541, 5.677, 9.083, -13.624, 22.706], [550.915, 70.442, 667.399, 113.366, 55.732, 118.747]],
  ["BRTIRUS0707A", [30, -20, 25, 40, -60, 100], [480.215, 353.778, 624.427, 151.857, -45.141, 112.719]],
  ["BRTIRUS0707A", [-120, 40, -30, -100, 80, -300], [-1.151, -230.994, 652.444, -101.622, 47.59, -140.963]],
  ["BRTIRUS0707A", [150, -100, 150, 155, -95, 330], [-464.016, 210.449, 599.55, -19.144, 57.762, -81.452]],
  ["BRTIRUS0707A", [-45, 60, 100, -150, 35, -20], [-457.346, 504.559, 644.875, 20.538, 37.671, 141.65]],
  ["BRTIRUS1820A", [10, 20, 10, 40, 50, 60], [629.432, 33.986, 1807.686, 20.848, -27.412, 88.534]],
  ["BRTIRUS1820A", [-45, -30, -20, -100, 35, -20], [918.215, -795.194, 452.212, -134.09, 6.342, -89.666]],
  ["GENERIC-SCARA", [0, 0, 0, 0], [600, 0, 300, 0, 0, 0]],
  ["GENERIC-SCARA", [40, -70, -120, 200], [489.621, 42.836, 180, 170, 0, 0]],
  ["GENERIC-SCARA", [-47.187, 100.953, -36.797, -208.897], [381.209, 21.912, 263.203, -155.131, 0, 0]],
  ["GENERIC-CARTESIAN", [186.4, 93.2, -111.84, 19.971], [186.4, 93.2, -111.84, 19.971, 0, 0]],
  ["GENERIC-CARTESIAN", [700, 350, -420, 75], [700, 350, -420, 75, 0, 0]],
];

test.each(TOLD)("%s at %j has its tool where r6 says", (name, axes, pose) => {
  const arm = model(name);
  const found = poseOf(arm, stands(arm, axes).tool);
  const apart = Math.hypot(...[0, 1, 2].map((at) => found[at]! - pose[at]!));
  // The axes of the samples are rounded, too.
  expect(apart, `${found}`).toBeLessThan(axes.every((axis) => Number.isInteger(axis)) ? 0.001 : 0.01);
  for (const at of [3, 4, 5]) {
    const turn = Math.abs(((found[at]! - pose[at]! + 540) % 360) - 180);
    expect(turn, `${found}`).toBeLessThan(0.002);
  }
});

test("each joint hangs on the one before, and the flange is tool_offset before tool 0", () => {
  const arm = model("BRTIRUS0707A");
  const { joints, flange, tool } = stands(arm, [12, -30, 40, 50, -60, 70]);
  expect(joints.length).toBe(6);
  const far = joints.map(({ moved }, at) => {
    const next = joints[at + 1]?.place.at ?? flange.at;
    return Math.hypot(...moved.at.map((one, part) => next[part]! - one));
  });
  const lengths = [Math.hypot(50, 296.5), 350, 41, 363, 0, 101.3];
  far.forEach((length, at) => expect(length).toBeCloseTo(lengths[at]!, 9));
  expect(Math.hypot(...tool.at.map((one, part) => flange.at[part]! - one))).toBeCloseTo(17, 9);
  // Z of the tool points on along the flange.
  tool.z.forEach((one, part) => expect(one).toBeCloseTo((tool.at[part]! - flange.at[part]!) / 17, 9));
});

test("limits are those of the geometry, with the sign and the offset of the axis", () => {
  const arm = model("BRTIRUS0707A");
  expect(rangeOf(arm, 0)).toEqual([-155, 155]);
  expect(rangeOf(arm, 1)).toEqual([-75 + 0.0603, 105 + 0.0603]);
  expect(geometric(arm, [10, 10])).toEqual([10, -10 + 0.0603, -0.1016, 0, 0.6383, 0]);
  expect([-155.1, -155, -150, 0, 155, 156].map((position) => nearness(position, [-155, 155]))).toEqual([
    "beyond",
    "near",
    "near",
    "inside",
    "near",
    "beyond",
  ]);
});

test("sizes go by the links, and the floor is below all that slides", () => {
  expect(["BRTIRUS0707A", "GENERIC-SCARA", "GENERIC-CARTESIAN"].map((name) => linksOf(model(name)))).toEqual([713, 600, 1500]);
  expect(["BRTIRUS0707A", "GENERIC-SCARA", "GENERIC-CARTESIAN"].map((name) => floorOf(model(name)))).toEqual([0, 0, -1000]);
  const [low, high] = spaceOf(model("GENERIC-SCARA"));
  expect([low, high]).toEqual([
    [-600, -600, 0],
    [600, 600, 300],
  ]);
});

test("the picture is a reading late, and never shows what was not read", () => {
  const late = new Late();
  expect(late.at(0)).toBeNull();
  late.read([0, 0], 1_000, 100);
  expect(late.at(1_000)).toEqual([0, 0]);
  late.read([10, 20], 1_100, 100);
  expect(late.at(1_100)).toEqual([0, 0]);
  expect(late.at(1_150)).toEqual([5, 10]);
  expect(late.isAt(1_150)).toBe(false);
  // No reading comes: it stays at the last one.
  expect(late.at(1_200)).toEqual([10, 20]);
  expect(late.at(9_000)).toEqual([10, 20]);
  // It stood until a period ago: it does not creep over the 8 s.
  late.read([20, 20], 9_100, 100);
  expect(late.at(9_150)).toEqual([15, 20]);
  late.read(null, 9_160, 100);
  expect(late.at(9_170)).toBeNull();
  // What comes after a gap begins where it is, and so does what is read seldom.
  late.read([1, 1], 9_200, 100);
  expect(late.at(9_200)).toEqual([1, 1]);
  late.read([2, 2], 19_200, 10_000);
  expect(late.at(19_200)).toEqual([2, 2]);
});

test("the path of a plan says where the arm is near a limit, and why the plan ended", () => {
  const arm = model("BRTIRUS0707A");
  const sample = (...axes: number[]) => ({ time_ms: 0, axes, axis_speeds: [], pose: [], tool_speed: 0 });
  const samples = [sample(0, 0, 0, 0, 0, 0), sample(150, 0, 0, 0, 0, 0), sample(155, 0, 0, 0, 0, 0)];
  const path = pathOf(arm, { samples, problems: [] });
  expect(path.map(({ kind }) => kind)).toEqual(["ok", "near", "near"]);
  expect(path[0]?.at[0]).toBeCloseTo(531.632, 2);
  const problem = (kind: "limit" | "singular" | "waiting") => ({ kind, message: "", at_ms: 0, step: 1, axis: null, alarm: null });
  const last = (kind: "limit" | "singular" | "waiting") => pathOf(arm, { samples, problems: [problem(kind)] })[2]?.kind;
  expect([last("limit"), last("singular"), last("waiting")]).toEqual(["beyond", "singular", "near"]);
});

test("the view turns round its target, follows the tool if asked, and never goes over the poles", () => {
  const orbit = new Orbit([0, 0, 300], 500);
  const far = (): number => Math.hypot(...orbit.eye.map((one, at) => one - orbit.target[at]!));
  const whole = far();
  orbit.turn(1, 9);
  expect(far()).toBeCloseTo(whole, 6);
  expect(orbit.eye[2]).toBeLessThan(300 + whole);
  orbit.zoom(1e9);
  expect(far()).toBeCloseTo(whole / 10, 6);
  orbit.view("tool", [400, 0, 500]);
  expect([orbit.follows, ...orbit.target]).toEqual([true, 400, 0, 500]);
  orbit.view("tool", null);
  expect([orbit.follows, ...orbit.target], "where the tool is is not known").toEqual([false, 0, 0, 300]);
  orbit.view("top", [400, 0, 500]);
  expect(orbit.eye[2]).toBeCloseTo(300 + whole, 0);
});

test("the workspace of a guard goes as far as its ranges, and elsewhere beyond what the tool can reach", () => {
  const scara = model("GENERIC-SCARA");
  expect(workspaceOf(scara, [])).toBeNull();
  const [low, high] = workspaceOf(scara, [{ of: "z", unit: "mm", lowest: 100, highest: 300 }]) ?? [];
  expect([low?.[2], high?.[2]]).toEqual([100, 300]);
  const [reachLow, reachHigh] = spaceOf(scara);
  for (const at of [0, 1] as const) {
    expect(low?.[at]).toBeLessThan(reachLow[at]);
    expect(high?.[at]).toBeGreaterThan(reachHigh[at]);
  }
});
