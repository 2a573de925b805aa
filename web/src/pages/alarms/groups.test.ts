import { expect, test } from "vitest";
import type { Production, RobotAlarm } from "../../api/types.ts";
import type { Entry } from "../../robots/attention.ts";
import { lastEnd, lasted, linesOf, pareto, shelvedOf } from "./groups.ts";
import { spanOf } from "./span.ts";

function entry(robot: string, code: number, since: number | null, part: Partial<Entry> = {}): Entry {
  return { key: `${robot} ${code}`, priority: 1, robots: [robot], since, kind: "alarm", code, text: "limit", acknowledged: null, ...part } as Entry;
}

function alarm(robot: string, code: number, part: Partial<RobotAlarm> = {}): RobotAlarm {
  const rest = { id: 1, text: "limit", axis: null, remedy: "", state: "active" as const, begin_seen: true, end_seen: false, until: null, acknowledged: null, shelved: null };
  return { robot, code, since: "1970-01-01T00:00:10Z", ...rest, ...part };
}

test("alarms of one code that begin within 2 s of each other are one line, from four robots on", () => {
  const of = (...since: (number | null)[]) => linesOf(since.map((at, place) => entry(`r${place}`, 9, at)), []).map(({ robots }) => robots.length);
  expect(of(0, 2_000, 4_000, 6_000)).toEqual([4]);
  expect(of(0, 2_000, 4_000)).toEqual([1, 1, 1]);
  expect(of(0, 2_000, 4_000, 6_001)).toEqual([1, 1, 1, 1]);
  expect(of(0, 0, 0, 0, null, 60_000)).toEqual([4, 1, 1]);
  const other = [entry("a", 9, 0), entry("b", 9, 1), entry("c", 8, 2), entry("d", 9, 3), entry("e", 9, 4, { priority: 2 })];
  const lines = linesOf(other, [alarm("a", 9), alarm("e", 9, { state: "unseen" }), alarm("d", 9, { state: "ended" })]);
  expect(lines.map(({ robots }) => robots)).toEqual([["a", "b", "d", "e"], ["c"]]);
  expect([lines[0]!.entry.priority, lines[0]!.alarms.map(({ robot }) => robot)]).toEqual([1, ["a", "e"]]);
});

test("links that are lost stay the one line that they are", () => {
  const links = { key: "links", priority: 2, robots: ["a", "b", "c", "d"], since: 0, kind: "no_link" } as Entry;
  expect(linesOf([links], [alarm("a", 9)])).toEqual([{ key: "links", entry: links, robots: links.robots, alarms: [] }]);
});

test("the last end of an alarm is known if the alarm has ended, and not known if it has not", () => {
  const ended = alarm("a", 1, { state: "ended", until: "1970-01-01T00:01:00Z" });
  expect(lastEnd([ended, alarm("b", 1, { state: "ended", until: "1970-01-01T00:00:30Z" }), alarm("c", 1)])).toEqual({ at: ended.until, isSeen: false });
  expect(lastEnd([alarm("c", 1)])).toBeNull();
});

test("a shelved code of a robot stands once, the first to end first", () => {
  const shelf = (until: string) => ({ by: "anna", at: "", until, reason: "door" });
  const [late, soon] = [shelf("2026-01-01T12:00:00Z"), shelf("2026-01-01T11:00:00Z")];
  const all = [alarm("a", 7, { shelved: late }), alarm("a", 7, { id: 2, shelved: late }), alarm("b", 7, { shelved: soon }), alarm("c", 7)];
  expect(shelvedOf(all).map(({ robot }) => robot)).toEqual(["b", "a"]);
});

test("what cost most time is first, with its part, and what the gateway left out is counted", () => {
  const of = (robot: string, codes: number, ...top: [number, number, number][]): Production =>
    ({ robot, alarms: { codes, top: top.map(([code, count, lost_ms]) => ({ code, text: `${code}`, remedy: "", count, lost_ms })) } }) as unknown as Production;
  const { costs, lost, hidden } = pareto([of("a", 25, [7, 2, 1_000], [9, 1, 500]), of("b", 1, [9, 3, 2_500])]);
  expect(costs.map(({ code, count, lost: ms, robots }) => [code, count, ms, robots])).toEqual([
    [9, 4, 3_000, ["a", "b"]],
    [7, 2, 1_000, ["a"]],
  ]);
  expect([lost, hidden, costs.map(({ part, sum }) => [part, sum])]).toEqual([4_000, 23, [[0.75, 0.75], [0.25, 1]]]);
  expect(pareto([of("a", 1, [7, 1, 0])]).costs[0]).toMatchObject({ part: 0, sum: 0 });
  expect(pareto([])).toEqual({ costs: [], lost: 0, hidden: 0 });
});

test("an alarm lies on the time line where it was, cut at its ends", () => {
  expect(spanOf(alarm("a", 1), 20_000, 20_000)).toEqual([0.5, 1]);
  expect(spanOf(alarm("a", 1, { until: "1970-01-01T00:00:15Z" }), 20_000, 20_000)).toEqual([0.5, 0.75]);
  expect(spanOf(alarm("a", 1), 40_000, 20_000)).toEqual([0, 1]);
});

test("how long an alarm lasted is said as far as its begin and its end were seen", () => {
  const of = (begin_seen: boolean, end_seen: boolean, until: string | null = "1970-01-01T00:01:10Z") =>
    lasted(alarm("a", 1, { state: "ended", until, begin_seen, end_seen }));
  expect(of(true, true)).toEqual({ seconds: 60, is: "exact" });
  expect(of(true, false), "it may have ended before").toEqual({ seconds: 60, is: "most" });
  expect(of(false, true), "it may have begun before").toEqual({ seconds: 60, is: "least" });
  expect(of(false, false)).toBeNull();
  expect(of(true, false, null)).toBeNull();
});
