import { beforeEach, expect, test, vi } from "vitest";
import { viewLike } from "../../../tests/view.ts";
import type { Answer } from "../../api/client.ts";
import type { Run } from "../../api/types.ts";
import type { View } from "../../robots/view.ts";

const TEXT = "[[instruction]]";
const LEASE = { number: 1, secret: "" };

/** A runner whose gateway answers as the test says. */
async function start() {
  vi.stubGlobal("location", { hash: "", pathname: "/", search: "", origin: "" });
  vi.stubGlobal("matchMedia", () => ({ matches: false, addEventListener: () => {} }));
  vi.resetModules();
  const asked: { method: string; path: string; body: unknown }[] = [];
  let answer = (_path: string): Answer<Run> => ({ kind: "unknown" });
  vi.doMock("../../api/client.ts", () => ({
    goByClock: () => {},
    call: async (method: string, path: string, more: { body?: unknown } = {}) => {
      asked.push({ method, path, body: more.body });
      return answer(path);
    },
    freshKey: () => "key",
    whenSignedOut: () => {},
  }));
  const { runner } = await import("./runner.svelte.ts");
  const { hall } = await import("../../state/hall.svelte.ts");
  return { runner, hall, asked, answers: (next: typeof answer) => void (answer = next) };
}

function run(part: Partial<Run>): Answer<Run> {
  return { kind: "ok", value: { run_id: 4, robot: "saw-twin", state: "done", ...part } as Run };
}

beforeEach(() => vi.unstubAllGlobals());

test("a text that ran on a twin counts for that twin, and not for another one of its name", async () => {
  const { runner, hall, answers } = await start();
  const there = (who: number): void => void (hall.views = [viewLike("saw-twin", { who })]);
  there(1);
  answers(() => run({}));
  await runner.send("saw-twin", { text: TEXT }, LEASE);
  expect([runner.hasRun("saw-twin", TEXT, null), runner.hasRun("saw-twin", `${TEXT} `, null), runner.hasRun("saw", TEXT, null)]).toEqual([
    true,
    false,
    false,
  ]);
  // The twin was started anew: a controller of the same name that has run nothing.
  there(2);
  expect(runner.hasRun("saw-twin", TEXT, null)).toBe(false);
  hall.views = [];
  expect(runner.hasRun("saw-twin", TEXT, null)).toBe(false);
});

test("a twin that was started anew while the text ran has not run it", async () => {
  const { runner, hall, answers } = await start();
  hall.views = [viewLike("saw-twin", { who: 1 })];
  answers(() => {
    hall.views = [viewLike("saw-twin", { who: 2 })];
    return run({});
  });
  await runner.send("saw-twin", { text: TEXT }, LEASE);
  expect(runner.of("saw-twin")?.kind).toBe("ended");
  expect(runner.hasRun("saw-twin", TEXT, null)).toBe(false);
});

test("a text that was stopped has not run, and nothing is sent a second time while that is not known", async () => {
  const { runner, hall, asked, answers } = await start();
  hall.views = [viewLike("saw-twin", { who: 1 })];
  answers(() => run({ state: "stopped" }));
  // Behind the name and the version another text may stand: the gateway is told which one was checked.
  const order = { text: TEXT, repeat: 3, kept: { name: "pick", version: 2, sha256: "5e" } };
  await runner.send("saw-twin", order, LEASE);
  expect(runner.hasRun("saw-twin", TEXT, null)).toBe(false);
  expect(asked).toEqual([{ method: "POST", path: "/v1/robots/saw-twin/programs/run", body: { name: "pick", version: 2, sha256: "5e", repeat: 3, lease: LEASE } }]);
  answers(() => ({ kind: "unknown" }));
  await runner.send("saw-twin", order, LEASE);
  expect([asked.length, runner.isUnknown("saw-twin"), runner.runs("saw-twin")]).toEqual([2, true, false]);
});

test("how the robot was before a run is kept for a run of this page alone, also if an event tells its number", async () => {
  const { runner, hall, answers } = await start();
  const before = viewLike("saw", { mode: 7, program: "pick" });
  hall.views = [before];
  answers(() => ({ kind: "refused", status: 409, problem: { code: "refused", message: "the list" } }));
  await runner.send("saw", { text: TEXT }, LEASE);
  hall.views = [viewLike("saw", { mode: 3 })];
  answers(() => run({ robot: "saw", state: "failed", lease: LEASE.number }));
  await runner.adopt("saw", 4);
  expect([runner.of("saw")?.kind, runner.before("saw")?.program, runner.textOf("saw")]).toEqual(["ended", "pick", TEXT]);
  answers(() => run({ robot: "saw", run_id: 5, state: "failed", lease: LEASE.number + 1 }));
  await runner.adopt("saw", 5);
  expect([runner.before("saw"), runner.textOf("saw")]).toEqual([null, null]);
});

test("a run of somebody else is shown, and not again once it was seen", async () => {
  const { runner, hall, asked, answers } = await start();
  hall.views = [viewLike("saw", { who: 1 })];
  answers(() => run({ robot: "saw", state: "failed", by: "token 2" }));
  await runner.adopt("saw", 4);
  expect(runner.of("saw")).toMatchObject({ kind: "ended", run: { by: "token 2" } });
  runner.forget("saw");
  await runner.adopt("saw", 4);
  expect([runner.of("saw"), asked.length]).toEqual([null, 1]);
});

test("a text that ran on a twin counts for its machine, its model and this session alone", async () => {
  const { runner, hall, answers } = await start();
  const identity = { machine_name: "A" } as NonNullable<View["summary"]["identity"]>;
  const there = (summary: Partial<View["summary"]>): void =>
    void (hall.views = [viewLike("saw-twin", { who: 1 }, { model: "M", virtual: true, identity, ...summary })]);
  const counts = (model: string | null = "M"): boolean => runner.hasRun("saw-twin", TEXT, model);
  there({});
  answers(() => run({}));
  await runner.send("saw-twin", { text: TEXT }, LEASE);
  expect([counts(), counts(null), counts("N")], "an arm of another model").toEqual([true, true, false]);
  const others: [string, Partial<View["summary"]>][] = [
    ["a twin of another model", { model: "N" }],
    ["another machine", { identity: { ...identity, machine_name: "B" } }],
    ["which machine is not known", { identity: null }],
    ["it is not told that it is a virtual one", { virtual: null }],
  ];
  for (const [what, summary] of others) {
    there(summary);
    expect([counts(), counts(null), counts("N")], what).toEqual([false, false, false]);
  }
  there({});
  expect(counts()).toBe(true);
  // The next session may be at another gateway, with the same names and numbers.
  hall.end();
  there({});
  expect(counts()).toBe(false);
});
