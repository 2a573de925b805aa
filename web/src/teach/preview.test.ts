import { expect, test } from "vitest";
import type { ProgramPlan, Run } from "../api/types.ts";
import type { View } from "../robots/view.ts";
import { hasStayed, type Basis, armAt, framesInUse, marksOf, nearLimits, stepAt, stepMarks, voidBy, voidByCommand } from "./preview.ts";
import { type Ready, mayRun, notSent, range, sentBy } from "./send.ts";

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

test("a preview is void when arm, robot, tool, frame, speed or text change", () => {
  const made: Basis = { text: "a", robot: "saw", machine: "m", model: "M", speed: 50, setSpeed: 50, axes: [1, 2], frames: "0 0" };
  const by = (part: Partial<Basis>) => voidBy(made, { ...made, ...part });
  expect(by({})).toBeNull();
  expect(by({ axes: [1.04, 2] })).toBeNull();
  expect([
    by({ text: "b" }),
    by({ robot: "saw-twin" }),
    by({ machine: "n" }),
    by({ model: null }),
    by({ speed: 60 }),
    by({ setSpeed: 30 }),
    by({ setSpeed: null }),
    by({ axes: [1.06, 2] }),
    by({ axes: [1] }),
    by({ axes: null }),
    by({ frames: "1 0" }),
    by({ frames: null }),
  ]).toEqual(["text", "robot", "robot", "model", "speed", "speed", "speed", "arm", "arm", "arm_unknown", "frames", "frames"]);
  expect(['modifyGSPD "300"', "switchTool \"1\"", "switchCoordinate", "modifyOutput"].map(voidByCommand)).toEqual([
    "speed",
    "frames",
    "frames",
    null,
  ]);
});

test("a plan is made without tool and work frame", () => {
  expect(['["0","0","0"]', '["0","0","3"]', '["2","0","0"]', '["0","1","0"]', '"0"', null].map(framesInUse)).toEqual([
    false,
    false,
    true,
    true,
    true,
    false,
  ]);
});

function view(part: Partial<View> = {}, summary: Partial<View["summary"]> = {}): View {
  return {
    name: "saw",
    quality: "fresh",
    mode: 7,
    alarm: 0,
    moving: false,
    homed: true,
    left: 0,
    program: null,
    parts: null,
    downSince: null,
    ...part,
    summary: { link: "up", stopped: false, identity_changed: null, ...summary } as View["summary"],
  };
}

const READY: Ready = {
  gateway: true,
  right: true,
  lease: true,
  hasTwin: true,
  tried: true,
  steps: 3,
  unread: false,
  checked: { ok: true, kind: "instructions" },
  repeats: false,
  appends: false,
  plan: { ended: "done", problems: [] },
  isVoid: null,
  runs: false,
  isUnknown: false,
};

test("a program is sent only if everything is known to be ready", () => {
  const by = (part: Partial<Ready>, seen: View = view()) => notSent(seen, { ...READY, ...part });
  expect(by({})).toEqual([]);
  expect(notSent(undefined, READY)).toEqual(["no_target"]);
  expect(by({ isUnknown: true }), "nothing is sent behind what may still run").toEqual(["look_first"]);
  expect([
    by({ gateway: false }),
    by({ right: false }),
    by({ lease: false }),
    by({ tried: false }),
    by({ tried: false, hasTwin: false }),
    by({ steps: 0 }),
    by({ unread: true }),
    by({ checked: null }),
    by({ checked: { ok: false, kind: "instructions" } }),
    by({ checked: { ok: true, kind: "taught" }, plan: null }),
    by({ repeats: true }),
    by({ appends: true }),
    by({ plan: null }),
    by({ isVoid: "arm" }),
    by({ plan: { ended: "alarm", problems: [limit] } }),
    by({ plan: { ended: "done", problems: [{ ...limit, kind: "passed_over" }] } }),
    by({ runs: true }),
  ]).toEqual([
    ["gateway_lost"],
    ["no_right"],
    ["no_lease"],
    ["twin_first"],
    ["no_twin"],
    ["no_steps"],
    ["unread_field"],
    ["checking"],
    ["mistakes"],
    ["taught"],
    ["repeats"],
    ["appends"],
    ["no_preview"],
    ["void"],
    ["plan_fails"],
    ["plan_fails"],
    ["run_under_way"],
  ]);
  const robots: [View, string[]][] = [
    [view({ mode: 2 }), ["not_started"]],
    [view({ mode: 9 }), ["not_started"]],
    [view({ mode: 1 }), ["manual"]],
    [view({ alarm: 7 }), ["alarm"]],
    [view({ moving: true }), ["moves"]],
    [view({ moving: null }), ["moves_unknown"]],
    [view({ left: 2 }), ["list"]],
    [view({ left: null }), ["list_unknown"]],
    [view({ homed: false }), ["not_homed"]],
    [view({ quality: "stale" }), ["stale"]],
    [view({}, { link: "down" }), ["no_link"]],
    [view({}, { stopped: true }), ["stop_holds"]],
  ];
  for (const [seen, reasons] of robots) expect(by({}, seen)).toEqual(reasons);
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

test("without a clear answer the outcome is unknown", () => {
  const run = { state: "running" } as Run;
  const refused = (status: number, code: string) =>
    sentBy({ kind: "refused", status, problem: { code: code as "refused", message: "no" } }).kind;
  expect(sentBy({ kind: "ok", value: run })).toEqual({ kind: "accepted", run });
  expect(sentBy({ kind: "ok", value: { ...run, state: "done" } }).kind).toBe("ended");
  expect(sentBy({ kind: "unknown" }).kind).toBe("unknown");
  expect([refused(504, "outcome_unknown"), refused(502, "unknown"), refused(500, "unknown")]).toEqual([
    "unknown",
    "unknown",
    "unknown",
  ]);
  expect([refused(409, "stopped"), refused(422, "bad_program"), refused(503, "overloaded")]).toEqual([
    "refused",
    "refused",
    "refused",
  ]);
  expect([mayRun(null), mayRun({ kind: "sent" }), mayRun({ kind: "ended", run }), mayRun({ kind: "unknown" })]).toEqual([
    false,
    true,
    false,
    false,
  ]);
});

test("the arm has stayed only if each axis is seen where it was", () => {
  expect(hasStayed([1, 2], [1, 2])).toBe(true);
  expect(hasStayed([1, 2], [1, 5]), "it moved").toBe(false);
  expect(hasStayed([1, 2], [1, null]), "it is not known any more").toBe(false);
  expect(hasStayed([1, null], [1, 3]), "it became known").toBe(false);
  // A four-axis arm has no others.
  expect(hasStayed([1, null], [1, null])).toBe(true);
});
