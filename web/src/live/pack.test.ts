import { expect, test } from "vitest";
import type { LiveSent, Signal } from "../api/types.ts";
import { MOST, Packer, SNAPSHOTS, Unpacker } from "./pack.ts";
import { type Change, Store } from "./store.ts";

function signal(address: string, value: Signal["value"], part: Partial<Signal> = {}): Signal {
  return { address, value, unit: address.startsWith("world") ? "mm" : null, quality: "fresh", age_ms: 40, ...part };
}

function snapshot(name: string, part: object = {}): LiveSent {
  const signals = [signal("curMode", 7), signal("axis-0", 1.5), signal("curMold", null, { quality: "none", age_ms: null })];
  return { type: "snapshot", name, link: "up", lease: null, stops_under_way: 0, period_ms: 100, signals, ...part } as unknown as LiveSent;
}

function change(robot: string, signals: Signal[], resume?: string): LiveSent {
  const all: LiveSent = { type: "change", robot, after: 1, number: 2, signals };
  return resume === undefined ? all : { ...all, resume };
}

/** Numbers between 0 and `below`, the same ones in each run. */
function dice(): (below: number) => number {
  let state = 7;
  return (below) => {
    state = (Math.imul(state, 1_103_515_245) + 12_345) >>> 0;
    return Math.floor((state / 2 ** 32) * below);
  };
}

test("what a page knows is the same, whether it takes each message by itself or many together", () => {
  const [plain, packed] = [new Store(), new Store()];
  const [packer, unpacker] = [new Packer(), new Unpacker()];
  const throwDice = dice();
  const robots = ["press", "saw", "weld"];
  const values: Signal["value"][] = [0, -1.5, 1e6, true, false, "PICK_3", null, { id: 0, current: 4, target: 9 }];
  const slow = (changes: Change[]): string[] => changes.filter((one) => one.kind !== "robot" || one.slow).map((one) => JSON.stringify(one));
  let told = new Set<string>();
  let seen = new Set<string>();
  for (let step = 0; step < 3_000; step += 1) {
    const now = 10_000 + step * 7;
    const robot = robots[throwDice(3)] ?? "saw";
    const kind = throwDice(20);
    const quality = (["fresh", "stale"] as const)[throwDice(8) === 0 ? 1 : 0]!;
    const read = (address: string): Signal => {
      const value = values[throwDice(values.length)] ?? null;
      return value === null ? signal(address, null, { quality: "none", age_ms: null }) : signal(address, value, { quality, age_ms: throwDice(90) });
    };
    const sent: LiveSent =
      kind === 0
        ? snapshot(robot)
        : kind === 1
          ? { type: "removed", robot }
          : kind === 2
            ? ({ type: "event", id: step, time: "", robot, event: "stop_began", by: "anna", holds: true } as LiveSent)
            : kind === 3
              ? { type: "reset", robot: null }
              : change(robot, [read("axis-0"), read("world-1"), read(throwDice(2) === 0 ? "curMode" : "counter-3")], kind < 9 ? `7-${step}` : undefined);
    for (const one of slow(plain.apply(sent, now))) told.add(one);
    packer.add(JSON.stringify(sent), now);
    if (throwDice(6) !== 0) continue;
    for (const item of unpacker.take(structuredClone(packer.take(now)))) for (const one of slow(packed.apply(item, now))) seen.add(one);
    expect(packed.resume).toBe(plain.resume);
    const asOf = (store: Store): unknown => [...store.robots].map(([name, { ticket: _ticket, ...rest }]) => [name, rest]);
    expect(asOf(packed)).toEqual(asOf(plain));
    // A robot that is gone at the end of the pass may be told of once more before: it costs a look at it.
    expect([...seen]).toEqual(expect.arrayContaining([...told]));
    expect([...seen].filter((one) => !told.has(one) && !one.includes('"kind":"robot"'))).toEqual([]);
    told = new Set();
    seen = new Set();
  }
});

test("of a value that changes often the last one waits, as old as it is when it leaves", () => {
  const [packer, unpacker] = [new Packer(), new Unpacker()];
  for (let at = 0; at < 10_000; at += 1) packer.add(JSON.stringify(change("saw", [signal("axis-0", at)], `7-${at}`)), 1_000 + at);
  const [item, ...more] = unpacker.take(packer.take(11_499));
  expect(more).toEqual([]);
  expect(item).toMatchObject({ type: "many", resume: "7-9999" });
  expect(item?.type === "many" ? [...item.each()] : []).toEqual([
    { robot: "saw", address: "axis-0", unit: null, value: 9_999, quality: "fresh", age: 540 },
  ]);
  expect(packer.isEmpty).toBe(true);
  // A message that this page does not know is a sign of life.
  packer.add('{"type":"newer"}', 0);
  expect([packer.isEmpty, packer.take(0).items]).toEqual([false, []]);
});

test("the snapshots of a hall come in several packs, and what comes behind them waits for its turn", () => {
  const [packer, unpacker] = [new Packer(), new Unpacker()];
  const names = Array.from({ length: 2 * SNAPSHOTS + 1 }, (_, at) => `robot-${at}`);
  for (const name of names) packer.add(JSON.stringify(snapshot(name)), 0);
  packer.add(JSON.stringify(change("robot-0", [signal("axis-0", 9)])), 0);
  const sizes: number[] = [];
  const store = new Store();
  while (!packer.isEmpty) {
    const items = unpacker.take(packer.take(0));
    sizes.push(items.length);
    for (const item of items) store.apply(item, 0);
  }
  expect(sizes).toEqual([SNAPSHOTS, SNAPSHOTS, 2]);
  expect([...store.robots.keys()]).toEqual(names);
  expect(store.robots.get("robot-0")?.values.get("axis-0")?.value).toBe(9);
});

test("a page that takes nothing lets no more wait than it may", () => {
  const packer = new Packer();
  for (let at = 0; at <= MOST; at += 1) {
    expect(packer.isFull).toBe(false);
    packer.add(JSON.stringify({ type: "removed", robot: "saw" }), 0);
  }
  expect(packer.isFull).toBe(true);
});
