import { expect, test } from "vitest";
import type { LiveSent, Signal } from "../api/types.ts";
import { viewOf } from "../robots/view.ts";
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
    link: "up",
    identity: null,
    identity_changed: null,
    virtual: true,
    lease: null,
    stopped: false,
    stops_under_way: 0,
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
  tell({ event: "stop_began", by: "anna" });
  tell({ event: "stop_ended", confirmed: true });
  expect([summary().stopped, summary().stops_under_way]).toEqual([true, 0]);
  tell({ event: "stop_cleared" });
  expect(summary().stopped).toBe(false);
  tell({ event: "link_down" }, 5_000);
  expect([summary().link, store.robots.get("saw")!.downSince]).toEqual(["down", 5_000]);
  tell({ event: "link_up" });
  expect([summary().link, store.robots.get("saw")!.downSince]).toEqual(["up", null]);
});

test("a value is as old as the gateway says, and as old as the gateway's last word once it is lost", () => {
  const value = { value: 1, unit: null, quality: "fresh" as const, asked: 1_000 };
  expect(shown(value, 60_000, null)).toEqual({ kind: "fresh" });
  expect(shown(value, 62_000, 60_000)).toEqual({ kind: "stale", age: 2_000 });
  expect(shown(value, 60_001 + DEAD, 60_000)).toEqual({ kind: "dead", age: DEAD + 1 });
  const stale = { ...value, quality: "stale" as const };
  expect(shown(stale, 2_500, null)).toEqual({ kind: "stale", age: 1_500 });
  expect(shown(stale, 9_000, null)).toEqual({ kind: "dead", age: 8_000 });
  expect(shown({ ...value, quality: "none", asked: null }, 0, null)).toEqual({ kind: "dead", age: null });
  expect(shown(undefined, 0, null)).toEqual({ kind: "dead", age: null });
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
