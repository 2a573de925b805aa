import { expect, test } from "vitest";
import type { Queried } from "../../api/types.ts";
import { addresses, nameOf, outputArguments, wordsOf } from "./io.ts";
import { withModel } from "./models.ts";
import { motorAddresses, motorsOf } from "./motors.ts";
import { freshKey } from "../../api/client.ts";
import { isRaise, numberOf, percentOf, wholeOf } from "./numbers.ts";
import { OLD, type PanelHas, PanelSpeeds, panelUnmet } from "./panel.ts";

test("points have the names of the pendant where these are known, and numbers elsewhere", () => {
  expect([0, 1, 7, 8, 31].map((bit) => nameOf("input", 0, bit))).toEqual(["X010", "X011", "X017", "X020", "X047"]);
  expect([nameOf("output", 0, 3), nameOf("M", 0, 1), nameOf("input", 1, 0), nameOf("M", 2, 31)]).toEqual([
    "Y013",
    "M011",
    "33",
    "96",
  ]);
  expect(outputArguments("output", 1, 5, true)).toEqual(["1", "5", "1"]);
  expect(outputArguments("M", 0, 1, false)).toEqual(["4", "1", "0"]);
});

test("words of 32 points are read to the last bit, and missing ones are left out", () => {
  expect(addresses(9)).toHaveLength(4 + 4 + 3);
  const signal = (address: string, value: number | null) =>
    ({ address, value, unit: null, quality: value === null ? "none" : "fresh", age_ms: 0 }) as const;
  const queried: Queried = {
    signals: [signal("input-0", 5), signal("output-1", 0x8000_0001), signal("M-0", null), signal("curMode", 7)],
    problems: [],
  };
  const words = wordsOf(queried);
  expect(words.map(({ kind, board }) => [kind, board])).toEqual([
    ["input", 0],
    ["output", 1],
  ]);
  expect(words[0]?.points.slice(0, 4)).toEqual([true, false, true, false]);
  expect(words[1]?.points.flatMap((isOn, at) => (isOn ? [at] : []))).toEqual([0, 31]);
});

test("numbers that the wire does not carry are not sent", () => {
  expect(["30", "0.1", "60,5", "100"].map(percentOf)).toEqual([30, 0.1, 60.5, 100]);
  expect(["0", "100.1", "5.55", "-3", "", "1e1"].map(percentOf)).toEqual([null, null, null, null, null, null]);
  expect([wholeOf("-7"), wholeOf("2147483648"), wholeOf("1.5"), wholeOf("799", 800, 900), wholeOf("900", 800, 900)]).toEqual([
    -7,
    null,
    null,
    null,
    900,
  ]);
  expect([isRaise(null, 5), isRaise(30, 60), isRaise(30, 30), isRaise(30, 10)]).toEqual([true, true, false, false]);
  expect(freshKey()).toMatch(/^[0-9a-f]{32}$/);
  expect(freshKey()).not.toBe(freshKey());
});

test("torques are percent of the rated one, and axes that the controller does not tell are left out", () => {
  const signal = (address: string, value: number | null) =>
    ({ address, value, unit: null, quality: value === null ? "none" : "fresh", age_ms: 0 }) as const;
  const signals = [signal("curSpeed-0", 1200), signal("curTorque-0", -1290), signal("curSpeed-1", null), signal("curTorque-2", 2580)];
  expect(motorAddresses(2)).toEqual(["curSpeed-0", "curSpeed-1", "curTorque-0", "curTorque-1"]);
  expect(motorsOf({ signals, problems: [] }, 3)).toEqual([
    { axis: 0, speed: 1200, torque: -50 },
    { axis: 2, speed: null, torque: 100 },
  ]);
});

test("a model is added to what the robot is configured with", () => {
  const read = ["curMode", "axis-0", "axis-5", "world-3", "lastCycle", "axis-6", "counter-2", "Addr-800"];
  const groups = [{ period_ms: 1000, read: ["counter-2", "curMode"], keep: false }];
  const robot = { address: "10.0.0.4:9760", period: 200, read, groups, parts: null, guard: null };
  expect(withModel(robot, "BRTIRUS0707A")).toEqual({
    address: "10.0.0.4:9760",
    period_ms: 200,
    read: ["axis-6", "Addr-800"],
    groups,
    model: "BRTIRUS0707A",
  });
  const guard = { max_speed: 50, max_path_speed: null, max_axis_step: null, max_distance: 400, axes: [], workspace: [] };
  const limited = withModel({ ...robot, parts: "counter-0", guard }, "BRTIRUS0707A");
  expect([limited.parts, limited.guard]).toEqual(["counter-0", guard]);
});

test("a number that is typed has three decimals at most and lies within its ends", () => {
  expect(["30", " 0,5 ", "1.25", "86400"].map((text) => numberOf(text, 0.5, 86_400))).toEqual([30, 0.5, 1.25, 86_400]);
  expect(["", "-1", "1e3", "0.4", "86401", "1.2345", "x"].map((text) => numberOf(text, 0.5, 86_400))).toEqual(
    Array(7).fill(null),
  );
});

test("each action at the panel needs what the gateway asks for", () => {
  const all: PanelHas = { gateway: true, role: "engineer", lease: true, answers: true, stopped: false, mode: 1 };
  const needs = ["stop", "move", "by_hand", "move_nothing", "input", "set_up", "begin_fault", "end_fault"] as const;
  const unmet = (has: Partial<PanelHas>) => needs.map((one) => panelUnmet(one, { ...all, ...has }).join(" "));
  expect(unmet({})).toEqual(["", "", "", "", "", "", "", ""]);
  expect(unmet({ lease: false })).toEqual(["", ...Array(6).fill("no_lease"), ""]);
  expect(unmet({ answers: false }), "its panel may answer all the same").toEqual(["", ...Array(5).fill("unanswered"), "", ""]);
  expect(unmet({ role: "operator" })).toEqual(["", "", "", "", ...Array(4).fill("needs_engineer")]);
  expect(unmet({ stopped: true })).toEqual(["", "stop_holds", "stop_holds", "", "stop_holds", "", "", ""]);
  expect(unmet({ mode: 7 })).toEqual(["", "", "not_manual", "", "", "", "", ""]);
  expect(unmet({ role: "viewer", gateway: false })[0]).toBe("gateway_lost no_right");
});

test("the global speed of a virtual robot is what its panel said lately", () => {
  const speeds = new PanelSpeeds();
  expect(speeds.of("saw", 0)).toBeNull();
  speeds.say("saw", 100, 1_000);
  speeds.say("press", 5, 1_000);
  expect([speeds.of("saw", 1_000), speeds.of("press", 1_000), speeds.of("weld", 1_000)]).toEqual([100, 5, null]);
  speeds.say("saw", 30, 2_000);
  expect([speeds.of("saw", 1_999 + OLD), speeds.of("saw", 2_000 + OLD), speeds.of("press", 2_000 + OLD)]).toEqual([30, null, null]);
});
