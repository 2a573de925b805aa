import { expect, test } from "vitest";
import type { LiveSent, Signal } from "../api/types.ts";
import { mayMove, viewOf } from "../robots/view.ts";
import { DEAD, shown } from "./age.ts";
import { Store } from "./store.ts";

function signal(address: string, value: Signal["value"], part: Partial<Signal> = {}): Signal {
  return { address, value, unit: null, quality: "fresh", age_ms: 40, ...part };
}

function snapshot(name: string, signals: Signal[], part: object = {}): LiveSent {
  return {
    type: "snapshot",
    name,
    address: "127.0.0.1:9760",
    managed_by: "file",
    model: null,
    guard: null,
    parts: null,
    link: "up",
    identity: null,
    identity_changed: null,
    virtual: true,
    lease: null,
    stopped: false,
    stopped_by: null,
    stops_under_way: 0,
    global_speed: null,
    period_ms: 100,
    epoch: 7,
    number: 1,
    signals,
    ...part,
  } as LiveSent;
}

test("a snapshot, then changes: only slow ones make a new view", () => {
  const store = new Store();
  const signals = [signal("curMode", 7), signal("axis-0", 1.5)];
  expect(store.apply(snapshot("saw", signals), 1_000)).toEqual([{ kind: "robot", name: "saw", slow: true }]);
  const change = (signals: Signal[]): LiveSent => ({ type: "change", robot: "saw", after: 1, number: 2, signals });
  expect(store.apply(change([signal("axis-0", 2.5)]), 2_000)).toEqual([{ kind: "robot", name: "saw", slow: false }]);
  expect(store.robots.get("saw")?.values.get("axis-0")).toEqual({ value: 2.5, unit: null, quality: "fresh", asked: 1_960 });
  expect(store.apply(change([signal("axis-0", 2.5, { quality: "stale" })]), 2_000)[0]).toMatchObject({ slow: true });
  expect(store.apply(change([signal("curMode", 2)]), 2_000)[0]).toMatchObject({ slow: true });
  expect(viewOf(store.robots.get("saw")!).mode).toBe(2);
  expect(store.apply({ type: "change", robot: "gone", after: 1, number: 2, signals: [] }, 0)).toEqual([]);
});

test("a robot tells which values are read with another period", () => {
  const store = new Store();
  const groups = [{ period_ms: 1000, read: ["counter-0"], keep: true }];
  store.apply(snapshot("saw", [], { groups }), 1_000);
  expect(store.robots.get("saw")).toMatchObject({ period: 100, groups });
  store.apply(snapshot("saw", []), 1_000);
  expect(store.robots.get("saw")?.groups).toEqual([]);
});

test("after a reset, robots that no snapshot tells of are gone at the end of the pass", () => {
  const store = new Store();
  store.apply(snapshot("press", []), 0);
  store.apply(snapshot("saw", []), 0);
  store.apply({ type: "reset", robot: null }, 0);
  expect(store.robots.size).toBe(2);
  const changes = store.apply({ ...snapshot("saw", []), resume: "8-1" } as LiveSent, 0);
  expect(changes).toEqual([
    { kind: "robot", name: "saw", slow: true },
    { kind: "removed", name: "press" },
  ]);
  expect([[...store.robots.keys()], store.resume]).toEqual([["saw"], "8-1"]);
});

test("link, lease and stop follow the events", () => {
  const store = new Store();
  store.apply(snapshot("saw", []), 0);
  const tell = (event: object, now = 0): void => {
    store.apply({ type: "event", id: 1, time: "", robot: "saw", ...event } as LiveSent, now);
  };
  const summary = () => store.robots.get("saw")!.summary;
  tell({ event: "lease_began", lease: 4, holder: "anna" });
  expect(summary().lease?.holder).toBe("anna");
  tell({ event: "lease_ended", lease: 3, holder: "ben", cause: "expired" });
  expect(summary().lease?.number).toBe(4);
  tell({ event: "lease_ended", lease: 4, holder: "anna", cause: "released" });
  expect(summary().lease).toBeNull();
  tell({ event: "stop_began", by: "gateway", holds: false });
  tell({ event: "stop_ended", confirmed: true });
  expect([summary().stopped, summary().stopped_by, summary().stops_under_way]).toEqual([false, null, 0]);
  tell({ event: "stop_began", by: "anna", holds: true, time: "10:42" });
  tell({ event: "stop_began", by: "ben", holds: true, time: "10:43" });
  tell({ event: "stop_ended", confirmed: true });
  tell({ event: "stop_ended", confirmed: true });
  expect([summary().stopped, summary().stops_under_way]).toEqual([true, 0]);
  expect(summary().stopped_by).toEqual({ by: "anna", at: "10:42" });
  tell({ event: "stop_cleared" });
  expect([summary().stopped, summary().stopped_by]).toEqual([false, null]);
  const set = { percent: 5, by: "anna", at: "10:44" };
  tell({ event: "global_speed", set });
  expect(summary().global_speed).toEqual(set);
  tell({ event: "global_speed", set: null });
  expect(summary().global_speed).toBeNull();
  tell({ event: "link_down" }, 5_000);
  expect([summary().link, store.robots.get("saw")!.downSince]).toEqual(["down", 5_000]);
  tell({ event: "link_up" });
  expect([summary().link, store.robots.get("saw")!.downSince]).toEqual(["up", null]);
});

test("a value is as old as the gateway says, and as old as the gateway's last word once it is lost", () => {
  const value = { value: 1, unit: null, quality: "fresh" as const, asked: 1_000 };
  expect(shown(value, 60_000, null, 100)).toEqual({ kind: "fresh" });
  expect(shown(value, 62_000, 60_000, 100)).toEqual({ kind: "stale", age: 2_000 });
  expect(shown(value, 60_001 + DEAD, 60_000, 100)).toEqual({ kind: "dead", age: DEAD + 1 });
  const stale = { ...value, quality: "stale" as const };
  expect(shown(stale, 2_500, null, 100)).toEqual({ kind: "stale", age: 1_500 });
  expect(shown(stale, 9_000, null, 100)).toEqual({ kind: "dead", age: 8_000 });
  expect(shown({ ...value, quality: "none", asked: null }, 0, null, 100)).toEqual({ kind: "dead", age: null });
  expect(shown(undefined, 0, null, 100)).toEqual({ kind: "dead", age: null });
});

test("a value that is read seldom is never one of now: it is as old as its period allows", () => {
  const value = { value: 1, unit: null, quality: "fresh" as const, asked: 1_000 };
  expect(shown(value, 1_500, null, 60_000)).toEqual({ kind: "fresh" });
  expect(shown(value, 4_000, null, 60_000)).toEqual({ kind: "slow", age: 3_000 });
  expect(shown(value, 3_600_000, null, 60_000)).toEqual({ kind: "slow", age: 61_000 });
  expect(shown(value, 3_600_000, null, 1_000)).toEqual({ kind: "fresh" });
  expect(shown(value, 3_601_000, 3_600_000, 60_000)).toEqual({ kind: "dead", age: 62_000 });
});

test("what is old, or read so seldom that it may be old, is not known", () => {
  const store = new Store();
  const all = (quality: Signal["quality"]): Signal[] => [
    signal("curMode", 2, { quality }),
    signal("curAlarm", 0, { quality }),
    signal("isMoving", false, { quality }),
    signal("RemoteCmdLen", 0, { quality }),
    signal("curMold", "pick", { quality }),
    signal("counter-0", { id: 0, target: 100, current: 41 }, { quality }),
  ];
  const seen = (quality: Signal["quality"], part: object = {}): unknown[] => {
    store.apply(snapshot("saw", all(quality), part), 0);
    const view = viewOf(store.robots.get("saw")!);
    return [view.moving, view.alarm, view.left, view.program, mayMove(view)];
  };
  const unknown = [null, null, null, null, true];
  expect(seen("fresh")).toEqual([false, 0, 0, "pick", false]);
  expect(seen("stale")).toEqual(unknown);
  expect(seen("fresh", { link: "down" })).toEqual(unknown);
  expect(seen("fresh", { period_ms: 4_000 })).toEqual([false, 0, 0, "pick", false]);
  expect(seen("fresh", { period_ms: 4_001 })).toEqual(unknown);
  const groups = [{ period_ms: 100, read: ["isMoving"], keep: true }, { period_ms: 5_000, read: ["curMold"], keep: true }];
  expect(seen("fresh", { period_ms: 4_001, groups })).toEqual([false, null, null, null, false]);
  expect(seen("fresh", { groups })).toEqual([false, 0, 0, null, false]);
  // An old alarm is still shown.
  store.apply(snapshot("saw", [signal("curAlarm", 7, { quality: "stale" })]), 0);
  expect(viewOf(store.robots.get("saw")!).alarm).toBe(7);
});

test("after another robot may have answered, it is not known whether it is a virtual one, until that was asked", () => {
  const identity = { expected: { machine_name: "A" }, found: { machine_name: "B" } };
  for (const event of [{ event: "link_up" }, { event: "identity_changed", ...identity }, { event: "identity_accepted", identity: identity.found }]) {
    const store = new Store();
    store.apply(snapshot("saw", []), 0);
    const before = store.robots.get("saw")!.summary;
    expect(before.virtual).toBe(true);
    const changes = store.apply({ type: "event", id: 1, time: "", robot: "saw", ...event } as unknown as LiveSent, 0);
    const ask = changes.find((change) => change.kind === "ask")!;
    expect(ask.name).toBe("saw");
    expect(store.robots.get("saw")!.summary.virtual).toBeNull();
    expect(store.known("saw", ask.ticket, { ...before, virtual: null }), "its name was not read yet").toBe(false);
    expect(store.known("saw", ask.ticket, { ...before, virtual: false })).toBe(true);
    expect(store.robots.get("saw")!.summary.virtual).toBe(false);
  }
});

test("an answer to an earlier question says nothing of the robot that answers now", () => {
  const store = new Store();
  store.apply(snapshot("saw", []), 0);
  const up = { type: "event", id: 1, time: "", robot: "saw", event: "link_up" } as LiveSent;
  const tickets = [up, up].map((sent) => store.apply(sent, 0).find((change) => change.kind === "ask")!.ticket);
  const summary = { ...store.robots.get("saw")!.summary, virtual: true };
  expect(store.known("saw", tickets[0]!, summary)).toBeNull();
  expect(store.robots.get("saw")!.summary.virtual).toBeNull();
  // A snapshot says it too, and is later than the question.
  store.apply(snapshot("saw", [], { virtual: false }), 0);
  expect([store.isAsked("saw", tickets[1]!), store.known("saw", tickets[1]!, summary)]).toEqual([false, null]);
  expect(store.robots.get("saw")!.summary.virtual).toBe(false);
});

test("of all robots nothing is known until the pass over them is at its end", () => {
  const store = new Store();
  expect(store.isPassing).toBe(true);
  store.apply(snapshot("press", []), 0);
  expect(store.isPassing).toBe(true);
  store.apply({ ...snapshot("saw", []), resume: "8-1" } as LiveSent, 0);
  expect(store.isPassing).toBe(false);
  store.apply({ type: "reset", robot: null }, 0);
  expect(store.isPassing).toBe(true);
});

test("after a lost connection nothing is known of all robots, until a sign of life says that all had their turn", () => {
  const store = new Store();
  store.apply({ ...snapshot("saw", []), resume: "8-1" } as LiveSent, 0);
  store.lost();
  expect(store.isPassing).toBe(true);
  store.apply({ type: "alive", time: "", passed_ms_ago: null }, 0);
  expect(store.isPassing).toBe(true);
  store.apply({ type: "alive", time: "", passed_ms_ago: 20 }, 0);
  expect(store.isPassing).toBe(false);
  expect([...store.robots.keys()]).toEqual(["saw"]);
});

test("a counter counts parts, and texts of old firmware count nothing", () => {
  const store = new Store();
  const counter = { id: 0, target: 100, current: 41 };
  store.apply(snapshot("saw", [signal("counter-0", counter), signal("curMold", "pick")]), 0);
  store.apply(snapshot("press", [signal("counter-0", "a"), signal("curMold", null, { quality: "none" })]), 0);
  const views = ["saw", "press"].map((name) => viewOf(store.robots.get(name)!));
  expect(views.map(({ parts, program }) => [parts, program])).toEqual([
    [41, "pick"],
    [null, null],
  ]);
});

test("the global speed of a robot without a link is not known: it may start again meanwhile", () => {
  const store = new Store();
  const set = { percent: 5, by: "token 1", at: "2026-11-25T06:00:00Z" };
  store.apply(snapshot("saw", [], { global_speed: set }), 0);
  const speed = () => viewOf(store.robots.get("saw")!).summary.global_speed;
  expect(speed()).toEqual(set);
  const event = { type: "event", id: 1, time: "2026-11-25T06:00:00Z", robot: "saw" };
  store.apply({ ...event, event: "link_down" } as LiveSent, 0);
  expect(speed()).toBeNull();
  // A short cut, of which the gateway knows that the robot has not started again: it tells nothing new.
  store.apply({ ...event, event: "link_up" } as LiveSent, 0);
  expect(speed()).toEqual(set);
});
