import { expect, test } from "vitest";
import { faultOf, lossesIn, sinceOf } from "./link.ts";
import { countsOf, ofGateway, samplesIn } from "./metrics.ts";
import type { HistoryEvent } from "./types.ts";
import { extra } from "../../robots/extra.ts";
import { changeOf, isPeriod, isRobotName, wantedOf } from "./wanted.ts";

const TEXT = `# HELP r6_gateway_robot_up Whether the robot answers.
# TYPE r6_gateway_robot_up gauge
r6_gateway_robot_up{robot="press-4"} 1
r6_gateway_robot_requests_total{robot="press-4"} 812
r6_gateway_robot_timeouts_total{robot="press-4"} 3
r6_gateway_raw_closed_total{robot="press-4",cause="too_slow"} 2
r6_gateway_raw_closed_total{robot="press-4",cause="denied"} 5
r6_gateway_robot_requests_total{robot="press-40"} 7
r6_gateway_history_bytes 4096
broken line here
r6_gateway_history_paused nothing
`;

test("numbers are read from the text, for one robot and for the gateway", () => {
  const samples = samplesIn(TEXT);
  expect(countsOf(samples, "press-4")).toMatchObject({ requests: 812, timeouts: 3, rawClosed: 7, reconnects: null });
  expect(countsOf(samples, "press-40").requests).toBe(7);
  expect(ofGateway(samples, "history_bytes")).toBe(4096);
  expect([ofGateway(samples, "history_paused"), ofGateway(samples, "robot_up")]).toEqual([null, null]);
});

test("who is at fault is said only as far as the links tell it", () => {
  const link = (name: string, isUp: boolean) => ({ name, isUp });
  expect(faultOf([link("a", false)], false)).toEqual({ kind: "gateway" });
  expect(faultOf([], true)).toEqual({ kind: "no_robot" });
  expect(faultOf([link("a", true), link("b", true)], true)).toEqual({ kind: "none" });
  expect(faultOf([link("a", false), link("b", true)], true)).toEqual({ kind: "some", robots: ["a"] });
  expect(faultOf([link("a", false), link("b", false)], true)).toEqual({ kind: "all", robots: ["a", "b"] });
  expect(faultOf([link("a", false)], true)).toEqual({ kind: "only", robots: ["a"] });
});

test("since when a link is as it is, comes from the last event, if that fits what is now", () => {
  const at = "2026-11-25T06:00:00Z";
  const event = (kind: string): HistoryEvent => ({ id: "1-1-1", time: at, event: kind }) as HistoryEvent;
  const events = [event("link_lost"), event("link_back")];
  expect(sinceOf(events, true)).toEqual({ kind: "at", at: Date.parse(at) });
  expect(sinceOf(events, false)).toEqual({ kind: "unknown" });
  expect(sinceOf([], true)).toEqual({ kind: "no_change" });
  // After a start, the gateway did not see when the link began.
  const unseen = { ...event("unseen"), from: null, to: "2026-11-25T07:00:00Z", because: "start" } as HistoryEvent;
  expect(sinceOf([...events, unseen], true)).toEqual({ kind: "at_least", at: Date.parse("2026-11-25T07:00:00Z") });
  const same = { ...unseen, to: at } as HistoryEvent;
  expect(sinceOf([same, ...events], true)).toEqual({ kind: "at", at: Date.parse(at) });
  expect(lossesIn(events)).toBe(1);
});

test("what is read besides the usual values is kept when a robot is changed", () => {
  const all = ["curMode", "axis-0", "axis-5", "axis-6", "world-5", "Addr-800", "counter-0", "lastCycle"];
  expect(extra(all, [])).toEqual(["axis-6", "Addr-800", "counter-0"]);
  expect(extra(all, [{ period_ms: 1000, read: ["counter-0", "curMode"], keep: true }])).toEqual(["axis-6", "Addr-800"]);
  expect(wantedOf({ address: " 10.0.0.4 ", period: "100", read: "Addr-800, counter-0\n", model: "" })).toEqual({
    address: "10.0.0.4",
    period_ms: 100,
    read: ["Addr-800", "counter-0"],
  });
  // A change takes away what it leaves out: so the limits are sent along.
  const guard = { max_speed: 50, max_path_speed: null, max_axis_step: null, max_distance: null, axes: [], workspace: [] };
  const groups = [{ period_ms: 1000, read: ["axis-7"], keep: true }];
  const typed = { address: "10.0.0.4", period: "100", read: "", model: "" };
  expect(changeOf(typed, { parts: "counter-2", guard }, groups)).toEqual({
    address: "10.0.0.4",
    period_ms: 100,
    read: [],
    groups,
    parts: "counter-2",
    guard,
  });
  expect(changeOf(typed, { parts: null, guard: null }, [])).toEqual({ address: "10.0.0.4", period_ms: 100, read: [], groups: [] });
  expect(["19", "20", "3600000", "3600001", "1e3", "", "-20"].map(isPeriod)).toEqual([false, true, true, false, false, false, false]);
  expect(["press-4", "Press", "", "a".repeat(33)].map(isRobotName)).toEqual([true, false, false, false]);
});
