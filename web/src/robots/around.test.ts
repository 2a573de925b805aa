import { expect, test } from "vitest";
import type { GatewayEvent, HistoryEvent, RobotAlarm } from "../api/types.ts";
import { deedsSince, rowsOf, spansOf } from "./around.ts";

const at = (seconds: number): string => new Date(Date.UTC(2026, 10, 25, 9, 0, 0) + seconds * 1000).toISOString();

function alarm(since: number, until: number | null): RobotAlarm {
  const state = until === null ? "active" : "ended";
  const known = { axis: null, begin_seen: true, end_seen: true, id: 1, remedy: "", text: "", acknowledged: null, shelved: null } as const;
  return { ...known, code: 5001, robot: "press-03", since: at(since), until: until === null ? null : at(until), state };
}

const seen = (seconds: number, what: object): HistoryEvent => ({ id: `${seconds}`, time: at(seconds), ...what }) as HistoryEvent;
const done = (id: number, seconds: number, what: object, robot = "press-03"): GatewayEvent =>
  ({ id, time: at(seconds), robot, ...what }) as GatewayEvent;

test("the minute around the begin and around the end are two spans, or one if they meet", () => {
  const seconds = (of: RobotAlarm): number[][] =>
    spansOf(of).map(({ from, to }) => [from, to].map((time) => (time - Date.parse(at(0))) / 1000));
  expect(seconds(alarm(0, null))).toEqual([[-60, 60]]);
  expect(seconds(alarm(0, 30))).toEqual([[-60, 90]]);
  expect(seconds(alarm(0, 120))).toEqual([[-60, 180]]);
  expect(seconds(alarm(0, 600))).toEqual([[-60, 60], [540, 660]]);
});

test("what was seen and what was done stand in the order of time, with the outcome of each command", () => {
  const history = [
    seen(-61, { event: "mode_changed", from: 2, to: 7 }),
    seen(-5, { event: "mode_changed", from: 7, to: 2 }),
    seen(0, { event: "alarm_began", code: 5001, text: "" }),
    seen(70, { event: "alarm_ended", code: 5001, text: "" }),
  ];
  const kept = [
    done(1, -20, { event: "lease_began", lease: 1, holder: "ann" }),
    done(2, -10, { event: "command_began", command_id: 4, command: "startButton" }),
    done(3, -9, { event: "command_ended", command_id: 4, outcome: "refused" }),
    done(4, -8, { event: "stop_began", by: "ann", holds: true }, "press-02"),
    done(5, 60, { event: "command_began", command_id: 5, command: "clearAlarm" }),
    done(6, 61, { event: "cycle_done", count: 1 }),
  ];
  const rows = rowsOf(alarm(0, 70), history, kept);
  expect(rows.map((row) => [row.event.event, row.kind === "deed" ? row.outcome : row.isItself])).toEqual([
    ["lease_began", null],
    ["command_began", "refused"],
    ["mode_changed", false],
    ["alarm_began", true],
    ["command_began", null],
    ["alarm_ended", false],
  ]);
});

test("it is said from when on the kept events tell what was done", () => {
  const first = (seconds: number): GatewayEvent[] => [done(1, seconds, { event: "stop_cleared" }, "another")];
  expect(deedsSince(alarm(0, null), first(-61))).toBe(null);
  expect(deedsSince(alarm(0, null), first(-30))).toBe(Date.parse(at(-30)));
  expect(deedsSince(alarm(0, null), [])).toBe(null);
});
