import { expect, test } from "vitest";
import type { Production, Shift } from "../../api/types.ts";
import { en } from "../../i18n/en.ts";
import { zh } from "../../i18n/zh.ts";
import { byShift, distribution, hallOf } from "./figures.ts";
import { areAlike, dayPeriod, daysOf, pairOf, queryOf, shiftsOf } from "./periods.ts";
import { availabilityOf, cyclesOf, cyclesUpTo, difference, partsOf, sumOf } from "./say.ts";

const BERLIN = "Europe/Berlin";
const NOW = Date.parse("2026-11-25T09:42:03Z");
const iso = (at: number): string => new Date(at).toISOString().slice(0, 16);

const NO_CYCLES = { count: 0, at_least: false, timed: 0, p50_ms: null, p90_ms: null, min_ms: null, max_ms: null, mean_ms: null, computed_from: ["cycle_done"] };

function figures(robot: string, part: Partial<Production> = {}): Production {
  return {
    robot,
    from: "2026-11-25T00:00:00Z",
    to: "2026-11-25T10:00:00Z",
    seen_ms: 10_000,
    unseen_ms: 0,
    states: { running_ms: 5_000, waiting_ms: 5_000, alarm_ms: 0, manual_ms: 0, other_ms: 0, computed_from: ["curMode"] },
    availability: { value: 0.5, definition: "running_of_seen_time", computed_from: ["curMode"] },
    cycles: { ...NO_CYCLES, count: 3 },
    parts: { count: 2, resets: 0, computed_from: ["counter-0"] },
    alarms: { codes: 0, top: [], computed_from: ["curAlarm"] },
    kept_until: null,
    unreadable: 0,
    ...part,
  };
}

test("today is beside yesterday up to the same time of the hall, wherever the browser is", () => {
  const [today, yesterday] = daysOf(new URLSearchParams(), NOW, BERLIN);
  expect(today).toMatchObject({ day: "2026-11-25", from: Date.parse("2026-11-24T23:00:00Z"), to: NOW, isPart: true });
  expect(yesterday).toMatchObject({ day: "2026-11-24", from: Date.parse("2026-11-23T23:00:00Z"), to: NOW - 86_400_000, isPart: true });
  const [, whole] = daysOf(new URLSearchParams("whole=1"), NOW, BERLIN);
  expect(whole).toMatchObject({ to: Date.parse("2026-11-24T23:00:00Z"), isPart: false });
  expect(queryOf(today!)).toBe("from=2026-11-24T23%3A00%3A00.000Z&to=2026-11-25T09%3A42%3A03.000Z");
  expect([areAlike(today!, yesterday!), areAlike(today!, whole!)]).toEqual([true, false]);
  // Days of the past are compared whole.
  const past = daysOf(new URLSearchParams("a=2026-10-25&b=2026-10-24"), NOW, BERLIN);
  expect(past.map((one) => (one?.kind === "day" ? (one.to - one.from) / 3_600_000 : null))).toEqual([25, 24]);
  expect(dayPeriod("2026-11-26", NOW, BERLIN), "it has not begun").toBeNull();
  for (const day of ["", "2026-13-01", "yesterday"]) expect(dayPeriod(day, NOW, BERLIN)).toBeNull();
  expect(daysOf(new URLSearchParams("a=nonsense"), NOW, BERLIN)[0]).toBeNull();
});

const EVERY = ["mon", "tue", "wed", "thu", "fri", "sat", "sun"] as const;
const SHIFTS: Shift[] = [
  { name: "early", days: ["mon", "tue", "wed", "thu", "fri"], begin: "06:00", end: "14:00" },
  { name: "night", days: [...EVERY], begin: "22:00", end: "06:00" },
];

test("this shift is beside the same one of an earlier day", () => {
  const all = shiftsOf(SHIFTS, NOW, BERLIN, 4);
  expect(all.map(({ name, date, from, isUnderWay }) => [name, date, iso(from), isUnderWay])).toEqual([
    ["early", "2026-11-25", "2026-11-25T05:00", true],
    ["night", "2026-11-24", "2026-11-24T21:00", false],
    ["early", "2026-11-24", "2026-11-24T05:00", false],
    ["night", "2026-11-23", "2026-11-23T21:00", false],
    ["early", "2026-11-23", "2026-11-23T05:00", false],
    ["night", "2026-11-22", "2026-11-22T21:00", false],
  ]);
  expect(areAlike(all[0]!, all[2]!), "one is under way").toBe(false);
  expect(areAlike(all[1]!, all[3]!)).toBe(true);
  const pair = (query: string) => pairOf(new URLSearchParams(query), all).map((one) => (one?.kind === "shift" ? `${one.name} ${one.date}` : null));
  expect(pair("")).toEqual(["early 2026-11-25", "early 2026-11-24"]);
  expect(pair("a=night@2026-11-24&b=early@2026-11-23")).toEqual(["night 2026-11-24", "early 2026-11-23"]);
  expect(pair("a=none@2026-11-24")).toEqual(["early 2026-11-25", "early 2026-11-24"]);
  expect(pairOf(new URLSearchParams(), [])).toEqual([null, null]);
  expect(queryOf(all[1]!)).toBe("shift=night&date=2026-11-24");
});

test("what a robot does not tell is named, and never 0", () => {
  const silent = figures("old", { cycles: NO_CYCLES, parts: { count: null, resets: 0, computed_from: [] } });
  const told = (isTold: boolean | null) => cyclesOf(silent, new Map([["old", isTold]]), en);
  expect([told(false), told(null), told(true)]).toEqual(["not told", "not known", "0"]);
  expect([partsOf(silent, en), partsOf(silent, zh)]).toEqual(["not told", "未提供"]);
  expect(availabilityOf(figures("a", { availability: { value: null, definition: "", computed_from: [] } }), en)).toBe("nothing was seen");
  expect(partsOf(figures("a", { parts: { count: 5, resets: 1, computed_from: [] } }), en)).toBe("at least 5");
  expect(cyclesOf(figures("a", { cycles: { ...NO_CYCLES, count: 4, at_least: true } }), new Map(), en)).toBe("at least 4");
  const hall = hallOf([silent, figures("new")], new Map([["old", false]]));
  expect(hall.cycles).toEqual({ value: 3, of: 1, missing: ["old"], unseen: [], atLeast: false });
  expect([sumOf(hall.cycles, 2, en), sumOf(hall.parts, 2, en)]).toEqual(["3 (1 of 2 robots)", "2 (1 of 2 robots)"]);
  const unseen = figures("away", { ...silent, robot: "away", seen_ms: 0, states: { ...silent.states, running_ms: 0, waiting_ms: 0 } });
  expect([partsOf(unseen, en), cyclesOf(unseen, new Map(), en)]).toEqual(["nothing was seen", "nothing was seen"]);
  expect(sumOf(hallOf([unseen], new Map()).cycles, 1, en)).toBe("nothing was seen");
  expect(hallOf([unseen, silent], new Map([["old", false]])).parts).toMatchObject({ missing: ["old"], unseen: ["away"] });
  const half = hallOf([unseen, figures("new")], new Map()).availability;
  expect(sumOf(half, 2, en, en.production.percent)).toBe("50.0 % (1 of 2 robots)");
  expect(difference(half, hallOf([figures("new")], new Map()).availability, en.production.points), "other robots").toBe("");
  const none = hallOf([silent], new Map([["old", false]]));
  expect([sumOf(none.cycles, 1, en), sumOf(none.parts, 1, zh), sumOf(none.parts, 0, en)]).toEqual(["not told", "未提供", ""]);
});

test("the hall is weighted by what was seen, and only figures of the same robots are subtracted", () => {
  const states = { ...figures("b").states, running_ms: 0, waiting_ms: 30_000 };
  const hall = hallOf([figures("a"), figures("b", { seen_ms: 30_000, states })], new Map());
  expect(hall.availability.value).toBe(5_000 / 40_000);
  expect(hallOf([], new Map()).availability.value).toBeNull();
  const sum = (value: number | null, missing: string[] = []) => ({ value, of: 2, missing, unseen: [], atLeast: false });
  expect([difference(sum(3), sum(5)), difference(sum(5), sum(5)), difference(sum(9), sum(5))]).toEqual(["−2", "0", "+4"]);
  expect([difference(sum(3), sum(null)), difference(sum(3), sum(5, ["a"])), difference({ ...sum(3), atLeast: true }, sum(1))]).toEqual(["", "", ""]);
});

test("cycle times of two spans share their bins, and each cycle is in one", () => {
  const bins = distribution([[12_010, 12_400, 13_990], [12_999, 12_400]]);
  expect(bins[0]).toMatchObject({ from: 12_000, to: 12_100, counts: [1, 0] });
  expect(bins.length).toBe(20);
  expect(bins.at(-1)).toMatchObject({ from: 13_900, counts: [1, 0] });
  const total = (at: number): number => bins.reduce((sum, { counts }) => sum + counts[at]!, 0);
  expect([total(0), total(1)]).toEqual([3, 2]);
  expect(distribution([[5], []])).toEqual([{ from: 5, to: 6, counts: [1, 0] }]);
  expect(distribution([[], []])).toEqual([]);
});

test("a shift of several robots is one row, the latest first", () => {
  const of = (robot: string, date: string): Production =>
    figures(robot, { shift: { name: "early", date, time_zone: BERLIN, begin: `${date}T05:00:00Z`, end: `${date}T13:00:00Z`, under_way: false } });
  const rows = byShift([of("a", "2026-11-24"), of("a", "2026-11-25"), of("b", "2026-11-24")]);
  expect(rows.map(({ date, figures: all }) => [date, all.map(({ robot }) => robot)])).toEqual([
    ["2026-11-25", ["a"]],
    ["2026-11-24", ["a", "b"]],
  ]);
});

test("of a part of the cycles it is said up to which time they took", () => {
  expect([cyclesUpTo(3_090, en), cyclesUpTo(12_340, en), cyclesUpTo(null, en), cyclesUpTo(undefined, en)]).toEqual(["up to 3.09 s", "up to 12.3 s", "", ""]);
});
