import { expect, test } from "vitest";
import type { Answer } from "../../api/client.ts";
import type { Audit, AuditEntry } from "../../api/types.ts";
import { headIn } from "./head.ts";
import { type Filter, MAX_WINDOWS, SHOWN, WINDOW, isRefused, numberAt, passes, search } from "./search.ts";

const ALL: Filter = { robot: "", who: "", kind: "", from: null, to: null };
const BEGIN = Date.parse("2026-11-25T06:00:00Z");

function entry(number: number, part: object = {}): AuditEntry {
  const time = new Date(BEGIN + number * 1000).toISOString();
  return { number, hash: "", time, actor: "anna", source: "10.0.0.7", robot: "press-4", what: "signed_in", ...part } as AuditEntry;
}

/** A gateway with these entries, which answers as the real one, and counts its questions. */
function log(entries: AuditEntry[], sees: (entry: AuditEntry) => boolean = () => true) {
  const asked: number[] = [];
  const ask = (after: number, limit: number): Promise<Answer<Audit>> => {
    asked.push(after);
    const page = entries.filter(({ number }) => number > after).slice(0, limit);
    const next_after = page.length === limit ? (page.at(-1)?.number ?? null) : null;
    return Promise.resolve({ kind: "ok", value: { entries: page.filter(sees), next_after } });
  };
  return { ask, asked };
}

const many = (from: number, to: number, part: (number: number) => object = () => ({})): AuditEntry[] =>
  Array.from({ length: to - from + 1 }, (_, at) => entry(from + at, part(from + at)));

async function value<T>(answer: Promise<Answer<T>>): Promise<T> {
  const one = await answer;
  if (one.kind !== "ok") throw new Error(one.kind);
  return one.value;
}

test("pages go back to the first entry, with each entry once", async () => {
  const { ask } = log(many(1, 1234));
  const seen: number[] = [];
  let before: number | null = 1235;
  while (before !== null) {
    const found: { entries: AuditEntry[]; next: number | null } = await value(search(ask, before, ALL));
    seen.push(...found.entries.map(({ number }) => number));
    expect(found.entries.length).toBeLessThanOrEqual(SHOWN);
    before = found.next;
  }
  expect(seen).toEqual(Array.from({ length: 1234 }, (_, at) => 1234 - at));
});

test("what is seldom is looked for in some windows, and the search says where it goes on", async () => {
  const last = WINDOW * MAX_WINDOWS + 200;
  const { ask, asked } = log(many(1, last, (number) => (number === 150 ? { what: "stop", confirmed: true } : {})));
  const first = await value(search(ask, last + 1, { ...ALL, kind: "stop" }));
  expect([first.entries.length, first.next, asked.length]).toEqual([0, 201, MAX_WINDOWS]);
  expect(first.back).toBe(entry(201).time);
  const second = await value(search(ask, 201, { ...ALL, kind: "stop" }));
  expect([second.entries.map(({ number }) => number), second.next]).toEqual([[150], null]);
});

test("a log whose begin was removed ends there, also for a token that sees one robot", async () => {
  const entries = many(5000, 5600, (number) => ({ robot: number % 2 === 0 ? "press-4" : "saw" }));
  for (const sees of [() => true, ({ robot }: AuditEntry) => robot === "saw"]) {
    const { ask, asked } = log(entries, sees);
    const found = await value(search(ask, 5601, { ...ALL, who: "ben" }));
    expect([found.entries.length, found.next]).toEqual([0, null]);
    expect(asked.length).toBeLessThanOrEqual(3);
  }
  const { ask } = log(entries);
  const found = await value(search(ask, 5010, ALL));
  expect(found.entries.map(({ number }) => number)).toEqual([5009, 5008, 5007, 5006, 5005, 5004, 5003, 5002, 5001, 5000]);
});

test("a time is found without reading the log", async () => {
  const { ask, asked } = log(many(1, 100_000));
  const number = await value(numberAt(ask, 100_000, BEGIN + 41_000 * 1000));
  expect(number).toBeGreaterThanOrEqual(41_000);
  expect(number).toBeLessThanOrEqual(41_000 + WINDOW);
  expect(asked.length).toBeLessThan(12);
  const kept = log(many(90_000, 100_000));
  expect(await value(numberAt(kept.ask, 100_000, BEGIN))).toBeLessThan(90_000 + WINDOW);
});

test("the search ends before the begin of the span", async () => {
  const { ask, asked } = log(many(1, 3000));
  const found = await value(search(ask, 3001, { ...ALL, from: BEGIN + 2990 * 1000 }));
  expect([found.entries.at(-1)?.number, found.next, asked.length]).toEqual([2990, null, 2]);
});

test("filters: robot, person, kind, span, refused", () => {
  const stop = entry(7, { what: "stop", confirmed: false, request: "stop", detail: "", actor: "3 (Screen)" });
  expect(passes(stop, { ...ALL, robot: "press-4", who: "screen", kind: "stop" })).toBe(true);
  expect(passes(stop, { ...ALL, robot: "press-5" })).toBe(false);
  expect(passes(stop, { ...ALL, who: "anna" })).toBe(false);
  expect(passes(stop, { ...ALL, kind: "lease" })).toBe(false);
  expect(passes(stop, { ...ALL, kind: "refused" })).toBe(false);
  expect([BEGIN + 7000, BEGIN + 7001].map((from) => passes(stop, { ...ALL, from }))).toEqual([true, false]);
  expect([BEGIN + 7000, BEGIN + 7001].map((to) => passes(stop, { ...ALL, to }))).toEqual([false, true]);
  expect(isRefused(entry(1, { what: "command_outcome", outcome: "refused" }))).toBe(true);
  expect(isRefused(entry(1, { what: "command_outcome", outcome: "unknown" }))).toBe(false);
  expect(isRefused(entry(1, { what: "refused", request: "stop", code: "not_allowed" }))).toBe(true);
});

test("a kept head is read, and nothing else is taken for one", () => {
  expect(headIn('{"number":812,"hash":"5d0c","time":"","note":"","key":""}\n')).toEqual({ number: 812, hash: "5d0c" });
  for (const text of ["", "{}", "[]", "null", '{"number":"812","hash":"5d0c"}', '{"number":0,"hash":"5d0c"}']) {
    expect(headIn(text), text).toBeNull();
  }
});
