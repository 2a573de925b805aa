import { expect, test } from "vitest";
import type { HistoryBucket } from "../api/types.ts";
import { type Bucket, Tail, bucketsOf, coarse, columns, extent, join, joins, widthOf } from "./buckets.ts";
import { fitted, misfit } from "./load.ts";
import { groupsOf, lookOf } from "./names.ts";
import { lone } from "./lone.ts";
import { limits, ownOf, queryOf, rangeOf } from "./range.ts";
import { Series } from "./series.ts";

function bucket(at: number, mean: number | null, part: Partial<Bucket> = {}): Bucket {
  return { at, width: 1_000, mean, min: mean, max: mean, seen: mean === null ? 0 : 1, ...part };
}

test("a bucket is as wide as a pixel, and no narrower than a robot is read", () => {
  expect(widthOf(900_000, 900)).toBe(1_000);
  expect(widthOf(900_001, 900)).toBe(1_001);
  expect([widthOf(60_000, 10_000), widthOf(1_000, 0)]).toEqual([20, 1_000]);
});

test("an answer's last bucket ends with the range, and is seen for its own time", () => {
  const of = (time: string, good_ms: number): HistoryBucket => ({ time, mean: 1, min: 0, max: 2, last: null, good_ms, samples: 1 });
  const answer = [of("1970-01-01T00:00:00Z", 1_000), of("1970-01-01T00:00:01Z", 250)];
  expect(bucketsOf(answer, 1_000, 1_500)).toEqual([
    { at: 0, width: 1_000, mean: 1, min: 0, max: 2, seen: 1 },
    { at: 1_000, width: 500, mean: 1, min: 0, max: 2, seen: 0.5 },
  ]);
});

test("no line crosses a gap, not even a gap narrower than a bucket", () => {
  const row = [bucket(0, 1), bucket(1_000, 3), bucket(2_000, null), bucket(3_000, 5), bucket(4_000, 7, { seen: 0.4 }), bucket(5_000, 9)];
  expect(row.map((one, at) => joins(one, row[at + 1]))).toEqual([true, false, false, false, false, false]);
  const [x, y] = columns(row, [row]);
  expect(x.slice(0, 4)).toEqual([0.5, 1, 1.5, 2]);
  expect(y).toEqual([1, 2, 3, null, null, null, 5, null, 7, null, 9, null]);
  expect(lone(y!)).toEqual([6, 8, 10]);
  // A bucket that is not there is a gap too.
  expect(columns(row.slice(0, 2), [[row[0], undefined]])[1]).toEqual([1, null, null, null]);
  expect(joins(bucket(0, 1), bucket(2_000, 1))).toBe(false);
});

test("a table joins buckets: means are weighted by what was seen", () => {
  const joined = join([bucket(0, 1, { seen: 0.5, min: -1 }), bucket(1_000, 4, { max: 9 }), bucket(2_000, null)]);
  expect(joined).toEqual({ at: 0, width: 3_000, mean: 3, min: -1, max: 9, seen: 0.5 });
  const all = Array.from({ length: 100 }, (_, at) => bucket(at * 1_000, at));
  expect(coarse(all, 24).map(({ at, width }) => [at, width]).slice(-1)).toEqual([[95_000, 5_000]]);
  expect([coarse(all, 24).length, coarse([], 24), join([]).mean]).toEqual([20, [], null]);
});

test("the scale has room for the band, and for one value alone", () => {
  expect(extent([[bucket(0, 1, { min: 0, max: 10 })], [bucket(0, null)]])).toEqual([-0.5, 10.5]);
  expect(extent([[bucket(0, 0)]])).toEqual([-1, 1]);
  expect(extent([[bucket(0, null)]])).toBeNull();
});

test("the live tail has values from look to look, and a gap where a value was not known or the page slept", () => {
  const tail = new Tail(0, 1_000, 3);
  for (const [at, value] of [[0, 1], [500, 3], [1_000, 3], [1_500, null], [2_000, 5]] as const) tail.look(at, value);
  const [first, second] = tail.buckets;
  expect(first).toMatchObject({ at: 0, width: 1_000, mean: 2, min: 1, max: 3, seen: 1 });
  expect(second).toMatchObject({ at: 1_000, mean: null, seen: 0 });
  tail.look(2_500, 5);
  tail.look(2_500 + Tail.SLEPT + 1, 5);
  expect(tail.buckets.map(({ at, mean }) => [at, mean])).toEqual([
    [3_000, null],
    [4_000, null],
    [5_000, null],
  ]);
});

test("a series has the history, and behind it the tail, on one grid", () => {
  const series = new Series(["a", "b"], 0, 2_500, 1_000, 10);
  series.put("a", [bucket(0, 1), bucket(2_000, 3, { width: 500 })]);
  for (const at of [2_500, 3_000, 3_500]) series.look("a", at, 4);
  for (const at of [2_500, 3_000, 3_500]) series.look("b", at, null);
  const { times, rows } = series.rows(500);
  expect(times).toEqual([
    { at: 0, width: 1_000 },
    { at: 1_000, width: 1_000 },
    { at: 2_000, width: 500 },
    { at: 2_500, width: 1_000 },
  ]);
  expect([rows.get("a")!.map(({ mean }) => mean), rows.get("b")!.map(({ mean }) => mean)]).toEqual([
    [1, null, 3, 4],
    [null, null, null, null],
  ]);
  // The end of the history is read a second time: it was not written yet.
  expect(series.end).toBe(0);
  const long = new Series(["a"], 0, 10_500, 1_000, 10);
  expect(long.end).toBe(7_000);
  long.put("a", Array.from({ length: 11 }, (_, at) => bucket(at * 1_000, at < 9 ? at : null)));
  long.mend("a", [7, 8, 9, 10].map((at) => bucket(at * 1_000, at + 0.5)));
  expect(long.rows(0).rows.get("a")!.map(({ mean }) => mean)).toEqual([0, 1, 2, 3, 4, 5, 6, 7.5, 8.5, 9.5, 10.5]);
  expect(series.rows(1_000).times[0]!.at, "what ended before is left out").toBe(1_000);
});

test("where values are gone, wider averages fill the places of the grid", () => {
  const part = (used: "exact" | "by_begin" | "not_used" | "incomplete", width_ms: number) => ({ from: "", to: "", width_ms, used });
  expect(misfit([])).toBe(0);
  expect(misfit([part("exact", 60_000), part("incomplete", 60_000)])).toBe(0);
  expect(misfit([part("not_used", 60_000), part("by_begin", 3_600_000)])).toBe(3_600_000);
  const question = { robot: "r", signal: "a", from: 90_000, to: 400_000, width: 70_000 };
  expect(fitted(question, 60_000)).toEqual({ ...question, from: 60_000, width: 120_000 });
  const series = new Series(["a"], 90_000, 400_000, 50_000, 10);
  series.put("a", [60_000, 180_000, 300_000].map((at) => bucket(at, at / 60_000, { width: 120_000 })));
  const { times, rows } = series.rows(0);
  expect(rows.get("a")!.map(({ mean }) => mean)).toEqual([1, 1, 3, 3, 5, 5, 5]);
  expect(rows.get("a")!.map(({ at, width }) => ({ at, width }))).toEqual(times);
});

test("a range stands in the query on the clock of the hall, and what is wrong is the usual one", () => {
  const of = (query: string) => rangeOf(new URLSearchParams(query), "Europe/Berlin");
  expect(of("span=7d")).toEqual({ kind: "live", span: "7d" });
  expect([of(""), of("span=toString"), of("from=2026-11-25T06:00")]).toEqual(Array(3).fill({ kind: "live", span: "15m" }));
  const own = of("from=2026-11-25T06:00&to=2026-11-25T14:00:30&span=7d");
  expect(own).toEqual({ kind: "own", from: Date.parse("2026-11-25T05:00:00Z"), to: Date.parse("2026-11-25T13:00:30Z") });
  expect(rangeOf(new URLSearchParams(queryOf(own, "Asia/Shanghai")), "Asia/Shanghai")).toEqual(own);
  expect(ownOf("2026-11-25T06:00", "2026-11-25T06:00", "UTC")).toBeNull();
  expect(ownOf("2006-11-25T06:00", "2026-11-25T06:00", "UTC")).toBeNull();
  expect(limits({ kind: "live", span: "15m" }, 1_000_000)).toEqual({ from: 100_000, to: 1_000_000 });
});

test("signals of one scale share a chart, and an axis has one colour everywhere", () => {
  const unit = (address: string): string | null => (address.endsWith("Cycle") ? "s" : null);
  const groups = groupsOf(["axis-0", "world-0", "lastCycle", "axis-1", "world-3", "curCycle", "Addr-800"], unit);
  expect(groups).toEqual([["axis-0", "axis-1"], ["world-0"], ["lastCycle", "curCycle"], ["world-3"], ["Addr-800"]]);
  expect(groupsOf(Array.from({ length: 9 }, (_, at) => `axis-${at}`), unit).map((group) => group.length)).toEqual([8, 1]);
  expect([lookOf("axis-2", 0), lookOf("axis-7", 0), lookOf("lastCycle", 1)]).toEqual([
    { colour: 3, isDashed: false },
    { colour: 2, isDashed: true },
    { colour: 2, isDashed: false },
  ]);
});
