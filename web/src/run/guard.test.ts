import { expect, test } from "vitest";
import { viewLike } from "../../tests/view.ts";
import type { RobotSummary } from "../api/types.ts";
import { consentOf } from "../robots/consent.ts";
import type { View } from "../robots/view.ts";
import {
  type Agreed,
  type Basis,
  CONSENT_VOIDS,
  type ConsentVoid,
  NEEDS,
  type NotSent,
  PLAN_VOIDS,
  type PlanVoid,
  type Ready,
  TREMBLE,
  notSent,
  voidBy,
  voidByCommand,
} from "./guard.ts";

const MADE: Basis = {
  isHeard: true,
  text: "a",
  version: '"3-a"',
  robot: "saw",
  machine: "m",
  model: "M",
  speed: 50,
  setSpeed: 50,
  axes: [1, 2],
  frames: '["0","0","0"]',
};

/** What is other than it was, and the reason that is told. */
const PLAN_ROWS: [what: string, now: Partial<Basis>, reason: PlanVoid][] = [
  ["the gateway is lost", { isHeard: false }, "gateway"],
  ["another robot is chosen", { robot: "saw-twin" }, "robot"],
  ["another machine of the same name answers", { machine: "n" }, "robot"],
  ["the model is another one", { model: "N" }, "model"],
  ["the model is not known any more", { model: null }, "model"],
  ["the text is another one", { text: "b" }, "text"],
  ["another version was stored", { version: '"4-b"' }, "version"],
  ["the program was removed and stored anew", { version: '"3-b"' }, "version"],
  ["the kept program is gone", { version: null }, "version"],
  ["it would be planned at another speed", { speed: 60 }, "speed"],
  ["another speed was set", { setSpeed: 30 }, "speed"],
  ["the speed is not known any more", { setSpeed: null }, "speed"],
  ["another tool is in use", { frames: '["1","0","0"]' }, "frames"],
  ["another work frame is in use", { frames: '["0","2","0"]' }, "frames"],
  ["tool and work frame are not told any more", { frames: null }, "frames"],
  ["values are old", { axes: null }, "arm_unknown"],
  ["an axis moved", { axes: [1 + TREMBLE + 0.01, 2] }, "arm"],
  ["an axis is not told any more", { axes: [1] }, "arm"],
];

test("each change makes a plan void for its own reason, and only because of its own rule", () => {
  expect(voidBy(PLAN_VOIDS, MADE, MADE)).toBeNull();
  expect(voidBy(PLAN_VOIDS, MADE, { ...MADE, axes: [1 + TREMBLE - 0.01, 2] }), "encoders tremble").toBeNull();
  for (const [what, part, reason] of PLAN_ROWS) {
    const now = { ...MADE, ...part };
    expect(voidBy(PLAN_VOIDS, MADE, now), what).toBe(reason);
    expect(voidBy(without(PLAN_VOIDS, reason), MADE, now), `${what}, without its rule`).toBeNull();
  }
  // A plan knows no tool and no work frame: with one of them in use it never held.
  const used = { ...MADE, frames: '["0","1","0"]' };
  expect(voidBy(PLAN_VOIDS, used, used)).toBe("frames_in_use");
  expect(voidBy(without(PLAN_VOIDS, "frames_in_use"), used, used)).toBeNull();
  for (const frames of ['["2","0","0"]', '"0"']) expect(voidBy(PLAN_VOIDS, { ...MADE, frames }, { ...MADE, frames })).toBe("frames_in_use");
  for (const frames of ['["0","0","3"]', null]) expect(voidBy(PLAN_VOIDS, { ...MADE, frames }, { ...MADE, frames })).toBeNull();
  // Without a start, where the arm stood is not known.
  expect(voidBy(PLAN_VOIDS, { ...MADE, axes: null }, MADE)).toBe("arm_unknown");
  const told = [...PLAN_ROWS.map(([, , reason]) => reason), "frames_in_use"];
  expect(PLAN_VOIDS.filter(({ reason }) => !told.includes(reason)), "rules without a row").toEqual([]);
});

test("commands that change what a plan was made of make it void", () => {
  const rows: [string, PlanVoid | null][] = [
    ['modifyGSPD "300"', "speed"],
    ['modifyAccDec "1" "2"', "speed"],
    ['switchTool "1"', "frames"],
    ["modifyTool", "frames"],
    ["switchCoordinate", "frames"],
    ["modifyCoordinate", "frames"],
    ["modifyOutput", null],
    ["modifyGSPDs", null],
  ];
  for (const [command, reason] of rows) expect(voidByCommand(command), command).toBe(reason);
});

function agreed(part: Partial<View> = {}, more: Partial<Agreed> = {}, summary: Partial<RobotSummary> = {}): Agreed {
  const view = viewLike("saw", { mode: 7, program: "main", ...part }, summary);
  return { lease: 5, isStopped: false, isFresh: true, view, consent: consentOf(view), ...more };
}

const CONSENT_ROWS: [what: string, now: Agreed, reason: ConsentVoid][] = [
  ["control has ended", agreed({}, { lease: null }), "lease"],
  ["control was taken anew", agreed({}, { lease: 6 }), "lease"],
  ["a stop was made", agreed({}, { isStopped: true }), "stop"],
  ["the state is old", agreed({}, { isFresh: false }), "stale"],
  ["another machine of the same name answers", agreed({ who: 2 }), "robot"],
  ["it is not told any more whether it is a virtual one", agreed({}, {}, { virtual: false }), "robot"],
  ["the controller has another program", agreed({ program: "other" }), "program"],
  ["the program is not told any more", agreed({ program: null }), "program"],
  ["something was added to the list", agreed({ left: 2 }), "list"],
];

test("each change makes void what a person agreed to, and only because of its own rule", () => {
  const made = agreed();
  expect(voidBy(CONSENT_VOIDS, made, agreed())).toBeNull();
  for (const [what, now, reason] of CONSENT_ROWS) {
    expect(voidBy(CONSENT_VOIDS, made, now), what).toBe(reason);
    expect(voidBy(without(CONSENT_VOIDS, reason), made, now), `${what}, without its rule`).toBeNull();
  }
  const told = CONSENT_ROWS.map(([, , reason]) => reason);
  expect(CONSENT_VOIDS.filter(({ reason }) => !told.includes(reason)), "rules without a row").toEqual([]);
});

function without<Rule extends { reason: string }>(rules: readonly Rule[], reason: string): Rule[] {
  return rules.filter((rule) => rule.reason !== reason);
}

const LIMIT = { kind: "limit" as const, step: 3, at_ms: 250, axis: "J1", alarm: 135, message: "J1 above its limit" };
const OTHER = { expected: {}, found: { machine_name: "B" } } as NonNullable<RobotSummary["identity_changed"]>;

const waiting = (part: Partial<View> = {}, summary: Partial<RobotSummary> = {}): View => viewLike("saw", { mode: 7, ...part }, summary);

const READY: Ready = {
  view: waiting(),
  gateway: true,
  right: true,
  lease: true,
  hasTwin: true,
  tried: true,
  isChosen: true,
  steps: 3,
  unread: false,
  checked: { ok: true, kind: "instructions" },
  isBeyondAxes: false,
  repeats: false,
  appends: false,
  isPlanned: true,
  plan: { ended: "done", problems: [] },
  isVoid: null,
  tells: { moving: true, list: true },
  runs: false,
  isUnknown: false,
};

const NEED_ROWS: [what: string, now: Partial<Ready>, reason: NotSent][] = [
  ["a program runs", { runs: true }, "run_under_way"],
  ["nothing is sent behind what may still run", { isUnknown: true }, "look_first"],
  ["the gateway is lost", { gateway: false }, "gateway_lost"],
  ["a viewer", { right: false }, "no_right"],
  ["no link", { view: waiting({}, { link: "down" }) }, "no_link"],
  ["another robot answers", { view: waiting({}, { identity_changed: OTHER }) }, "other_robot"],
  ["somebody else has control", { lease: false }, "no_lease"],
  ["its state is old", { view: waiting({ quality: "stale" }) }, "stale"],
  ["a stop holds", { view: waiting({}, { stopped: true }) }, "stop_holds"],
  ["an alarm", { view: waiting({ alarm: 7 }) }, "alarm"],
  ["manual", { view: waiting({ mode: 1 }) }, "manual"],
  ["single steps", { view: waiting({ mode: 8 }) }, "manual"],
  ["an arm without a twin", { hasTwin: false, tried: false }, "no_twin"],
  ["no program is chosen", { isChosen: false, steps: 0, checked: null, isPlanned: false, plan: null }, "no_program"],
  ["no step", { steps: 0, checked: null, isPlanned: false, plan: null }, "no_steps"],
  ["a field is no value", { unread: true }, "unread_field"],
  ["not checked yet", { checked: null, isPlanned: false, plan: null }, "checking"],
  ["a mistake", { checked: { ok: false, kind: "instructions" } }, "mistakes"],
  ["a step moves an axis that the robot lacks", { isBeyondAxes: true }, "too_many_axes"],
  ["a taught program", { checked: { ok: true, kind: "taught" }, isPlanned: false, plan: null }, "taught"],
  ["it repeats without an end", { repeats: true }, "repeats"],
  ["it appends", { appends: true }, "appends"],
  ["no plan, or it was run already", { isPlanned: false }, "no_preview"],
  ["the plan is void", { isVoid: "arm" }, "void"],
  ["the plan ends early", { plan: { ended: "alarm", problems: [LIMIT] } }, "plan_fails"],
  ["the plan has a problem", { plan: { ended: "done", problems: [{ ...LIMIT, kind: "passed_over" }] } }, "plan_fails"],
  ["it did not run on the twin", { tried: false }, "twin_first"],
  ["the controller rests", { view: waiting({ mode: 2 }) }, "not_started"],
  ["a single cycle", { view: waiting({ mode: 9 }) }, "not_started"],
  ["it is not homed", { view: waiting({ homed: false }) }, "not_homed"],
  ["the arm moves", { view: waiting({ moving: true }) }, "moves"],
  ["whether the arm moves is not known", { view: waiting({ moving: null }) }, "moves_unknown"],
  ["instructions are left", { view: waiting({ left: 2 }) }, "list"],
  ["what is left is not known", { view: waiting({ left: null }) }, "list_unknown"],
];

test("a program is sent only if everything is known to be ready: each need has its reason, from its own rule", () => {
  expect(notSent(READY)).toEqual([]);
  expect(notSent(null)).toEqual(["no_target"]);
  expect(notSent({ ...READY, plan: null }), "without a model there is no path").toEqual([]);
  const silent = { moving: false, list: false };
  const old = waiting({ moving: null, left: null });
  expect(notSent({ ...READY, view: old, tells: silent }), "a firmware that never tells it").toEqual([]);
  for (const [what, part, reason] of NEED_ROWS) {
    const now = { ...READY, ...part };
    expect(notSent(now), what).toEqual([reason]);
    expect(notSent(now, without(NEEDS, reason)), `${what}, without its rule`).toEqual([]);
  }
  const told = NEED_ROWS.map(([, , reason]) => reason);
  expect(NEEDS.filter(({ reason }) => !told.includes(reason)), "rules without a row").toEqual([]);
});

test("what is not known now is not told as a reason: first the access, then the state", () => {
  const view = waiting({ mode: 2, alarm: 7, left: 2 }, { stopped: true });
  expect(notSent({ ...READY, view, lease: false })).toEqual(["no_lease", "not_started", "list"]);
  const down = waiting({}, { link: "down", identity_changed: OTHER });
  expect(notSent({ ...READY, view: down, gateway: false })).toEqual(["gateway_lost"]);
  expect(notSent({ ...READY, view: { ...view, quality: "stale" } })).toEqual(["stale", "stop_holds", "alarm"]);
  expect(notSent({ ...READY, view, runs: true, isUnknown: true })).toEqual(["run_under_way"]);
});
