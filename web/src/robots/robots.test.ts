import { expect, test } from "vitest";
import type { RobotAlarm, RobotSummary } from "../api/types.ts";
import { viewLike } from "../../tests/view.ts";
import { attention, frozen } from "./attention.ts";
import { changed, consentOf, mayRunLeftover } from "./consent.ts";
import { doing, unmet } from "./sentence.ts";
import { type View, inOrder, mayMove } from "./view.ts";

function view(name: string, part: Partial<View> = {}, summary: Partial<RobotSummary> = {}): View {
  return viewLike(name, part, summary);
}

function alarm(robot: string, code: number, part: Partial<RobotAlarm> = {}): RobotAlarm {
  return {
    robot,
    id: 1,
    code,
    text: "emergency stop",
    axis: null,
    remedy: "",
    state: "active",
    since: "1970-01-01T00:00:10Z",
    begin_seen: true,
    end_seen: false,
    until: null,
    acknowledged: null,
    shelved: null,
    ...part,
  };
}

const OTHER = { expected: {}, found: { machine_name: "B" } } as NonNullable<RobotSummary["identity_changed"]>;
const HAS = { gateway: true, right: true, lease: true };

test("what has to be mended first is said first", () => {
  const said = (part: Partial<View>, summary: Partial<RobotSummary> = {}): string =>
    doing(view("saw", part, summary), []).kind;
  expect(said({ alarm: 7 }, { link: "down", identity_changed: OTHER })).toBe("no_link");
  expect(said({ alarm: 7 }, { identity_changed: OTHER })).toBe("other_robot");
  expect(said({ mode: null })).toBe("not_read");
  expect(said({ alarm: 7, moving: true }, { stopped: true })).toBe("alarm");
  expect(said({ moving: true }, { stopped: true })).toBe("moves");
  expect(said({}, { stopped: true })).toBe("stop_holds");
  expect([1, 8, 7, 9, 2, 3, 5].map((mode) => said({ mode }))).toEqual([
    "manual",
    "manual",
    "runs",
    "runs",
    "waits_for_start",
    "stopped",
    "unknown_mode",
  ]);
  const named = doing(view("saw", { alarm: 7 }), [alarm("saw", 7, { state: "ended", text: "old" }), alarm("saw", 7)]);
  expect(named).toEqual({ kind: "alarm", code: 7, text: "emergency stop" });
});

test("that the arm stands is said only if it is seen now", () => {
  const said = (part: Partial<View>, summary: Partial<RobotSummary> = {}) => doing(view("saw", part, summary), []);
  for (const [part, summary] of [
    [{}, { stopped: true }],
    [{}, {}],
    [{ mode: 3 }, {}],
    [{ mode: 7 }, {}],
  ] as const) {
    expect(said(part, summary)).toMatchObject({ stands: true });
    expect(said({ ...part, moving: null }, summary)).toMatchObject({ stands: false });
    expect(said({ ...part, quality: "stale" }, summary)).toMatchObject({ stands: false });
  }
  // A program that runs although a stop holds does not stand.
  expect(said({ mode: 7, moving: null }, { stopped: true })).toMatchObject({ kind: "runs", stands: false });
  expect(said({ mode: 7 }, { stopped: true }).kind).toBe("runs");
});

test("a consent holds for what was said, and for nothing else", () => {
  const before = view("saw", { program: "pick", left: 3 }, { virtual: true });
  const told = consentOf(before);
  expect(changed(told, { ...before, name: "twin-of-saw" }), "another robot of the same kind").toBe("robot");
  const now = (part: Partial<View>, summary: Partial<RobotSummary> = {}) =>
    changed(told, view("saw", { program: "pick", left: 3, ...part }, { virtual: true, ...summary }));
  expect(now({})).toBeNull();
  expect(now({ who: 2 }), "another machine of the same name and kind").toBe("robot");
  expect(now({ left: 4 })).toBe("left");
  expect(now({ left: null })).toBe("left");
  expect(now({ program: "place" })).toBe("program");
  expect(now({}, { virtual: false })).toBe("robot");
  expect(now({}, { virtual: null })).toBe("robot");
  expect(now({}, { identity_changed: OTHER })).toBe("robot");
  expect(mayRunLeftover(told)).toBe(true);
  const empty = consentOf(view("saw", { left: 0 }));
  expect(mayRunLeftover(empty)).toBe(false);
  expect(changed(empty, view("saw", { left: 2 }))).toBe("left");
  expect(changed(empty, view("saw", { left: null })), "the gateway refuses what is left").toBeNull();
  expect(mayRunLeftover(consentOf(view("saw", { left: null }))), "the dialog said that it may run").toBe(true);
  const slow = { percent: 10, by: "anna", at: "2026-11-25T06:00:00Z" };
  const at10 = consentOf(view("saw", {}, { global_speed: slow }));
  expect(changed(at10, view("saw", {}, { global_speed: { ...slow, percent: 100 } }))).toBe("speed");
  expect(changed(at10, view("saw", {}, { global_speed: null })), "it is not known any more").toBe("speed");
  expect(changed(at10, view("saw", {}, { global_speed: slow }), 100), "the panel says another one").toBe("speed");
});

test("of robots whose state is not known it is not said that they need no person", () => {
  const count = (...views: View[]) => attention(views, [], (at) => at).unknown;
  expect(count(view("a"))).toBe(0);
  expect(count(view("a", { quality: "stale" }), view("b", { quality: "none" }), view("c", { alarm: null }), view("d"))).toBe(3);
  // Those are in the list.
  expect(count(view("a", {}, { link: "down" }), view("b", { alarm: 7, quality: "stale" }))).toBe(0);
});

test("a start needs everything, a pause no lease", () => {
  expect(unmet("start", view("saw"), HAS)).toEqual([]);
  expect(unmet("start", view("saw", { alarm: 7, mode: 1 }, { stopped: true }), HAS)).toEqual([
    "stop_holds",
    "alarm",
    "manual",
  ]);
  expect(unmet("start", view("saw", { mode: 7 }), HAS)).toEqual(["running"]);
  expect(unmet("start", view("saw", { quality: "stale" }), HAS)).toEqual(["stale"]);
  // After a stop some firmware is in mode 3 with an alarm: the alarm is cleared first, then the key is turned.
  expect(unmet("start", view("saw", { alarm: 42, mode: 3 }), HAS)).toEqual(["alarm", "mode_stop"]);
  expect(unmet("clear_alarm", view("saw", { alarm: 42, mode: 3 }), HAS)).toEqual([]);
  const nothing = { gateway: false, right: false, lease: false };
  const down = view("saw", {}, { link: "down" });
  expect(unmet("start", down, { ...nothing, gateway: true })).toEqual(["no_right", "no_link", "no_lease"]);
  expect(unmet("start", down, nothing), "a link of now is not known").toEqual(["gateway_lost", "no_right", "no_lease"]);
  const free = { ...HAS, lease: false };
  expect(unmet("pause", view("saw", { mode: 7 }), free)).toEqual([]);
  expect(unmet("pause", view("saw"), free)).toEqual(["not_running"]);
  expect(unmet("pause", view("saw", { moving: null }), free)).toEqual([]);
  expect(unmet("clear_alarm", view("saw"), HAS)).toEqual(["no_alarm"]);
  expect(unmet("clear_stop", view("saw", {}, { stopped: true }), HAS)).toEqual([]);
});

test("what may start a motion needs that no stop holds", () => {
  expect(unmet("change", view("saw", {}, { stopped: true }), HAS)).toEqual([]);
  expect(unmet("change", view("saw", { mode: 1 }), HAS)).toEqual(["manual"]);
  expect(unmet("may_move", view("saw", { mode: 1 }, { stopped: true }), HAS)).toEqual(["stop_holds", "manual"]);
  expect(unmet("may_move", view("saw"), { ...HAS, lease: false })).toEqual(["no_lease"]);
});

test("whose turn it is to clear a stop is said", () => {
  const stopped = view("saw", { mode: 2, moving: false }, { stopped: true });
  expect(doing(stopped, [])).toMatchObject({ kind: "stop_holds", mine: false });
  expect(doing(stopped, [], true)).toMatchObject({ kind: "stop_holds", mine: true });
});

test("the list has what needs a person, the most urgent and longest first", () => {
  const by = { by: "anna", at: "", comment: null };
  const { entries, shelved } = attention(
    [
      view("a", { downSince: 5_000 }, { link: "down" }),
      view("b", { alarm: 7 }),
      view("c", { alarm: 8 }),
      view("d", { alarm: 9 }),
      view("e", { alarm: 3 }),
      view("f", {}, { stopped: true }),
      view("i", { mode: 7 }, { stopped: true }),
      view("j", { moving: true }, { stopped: true }),
      view("k", { mode: 7, quality: "stale" }, { stopped: true }),
      view("g", {}, { identity_changed: OTHER }),
      view("h"),
    ],
    [
      alarm("b", 7, { since: "1970-01-01T00:00:20Z" }),
      alarm("c", 8, { since: "1970-01-01T00:00:10Z" }),
      alarm("d", 9, { acknowledged: by }),
      alarm("e", 3, { shelved: { by: "anna", at: "", until: "", reason: "" } }),
    ],
    (at) => at + 1_000,
  );
  const told = entries.map(({ priority, robots, kind, since }) => [priority, robots[0], kind, since]);
  expect(told).toEqual([
    [1, "c", "alarm", 10_000],
    [1, "b", "alarm", 20_000],
    [1, "i", "runs_although_stopped", null],
    [1, "j", "runs_although_stopped", null],
    [1, "g", "other_robot", null],
    [2, "a", "no_link", 6_000],
    [2, "d", "alarm", 10_000],
    [2, "f", "stop_holds", null],
    [2, "k", "stop_holds", null],
  ]);
  expect(shelved).toBe(1);
});

test("a lost switch is one line", () => {
  const views = ["a", "b", "c", "d"].map((name, at) => view(name, { downSince: 9_000 - at }, { link: "down" }));
  const { entries } = attention(views, [], (at) => at);
  expect(entries).toMatchObject([{ kind: "no_link", robots: ["a", "b", "c", "d"], since: 8_997 }]);
});

test("a list that somebody points at keeps its order and counts what waits", () => {
  const all = attention([view("a", { alarm: 1 }), view("b", { alarm: 2 }), view("c", { alarm: 3 })], [], (at) => at);
  const keys = all.entries.map((entry) => entry.key);
  const { entries, waiting } = frozen([keys[2]!, "gone", keys[0]!], all.entries);
  expect([entries.map((entry) => entry.robots[0]), waiting]).toEqual([["c", "a"], 1]);
});

test("a robot may move unless it is seen that it does not", () => {
  expect(mayMove(view("a"))).toBe(false);
  expect(mayMove(view("a", { mode: 7 }))).toBe(true);
  expect(mayMove(view("a", { moving: true }))).toBe(true);
  expect(mayMove(view("a", { quality: "stale" }))).toBe(true);
  expect(mayMove(view("a", {}, { link: "down" }))).toBe(true);
});

test("a stop that holds is told with who made it and since when, if that is known", () => {
  const stopped_by = { by: "token 3 (shift)", at: "2026-11-25T06:00:00Z" };
  const { entries } = attention([view("a", {}, { stopped: true, stopped_by }), view("b", {}, { stopped: true })], [], (at) => at);
  expect(entries.map(({ robots, since, ...more }) => [robots[0], since, "by" in more ? more.by : undefined])).toEqual([
    ["a", Date.parse(stopped_by.at), stopped_by.by],
    ["b", null, null],
  ]);
});

test("real arms stand first in the list of stops, and twins last", () => {
  const of = (name: string, virtual: boolean | null, twin_of: string | null = null): View => view(name, {}, { virtual, twin_of });
  const views = [of("a-twin", true, "a"), of("b", true), of("c", null), of("a", false)];
  expect(inOrder(views).map(({ name }) => name)).toEqual(["c", "a", "b", "a-twin"]);
});
