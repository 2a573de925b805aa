import { beforeEach, expect, test, vi } from "vitest";
import type { Answer } from "../../api/client.ts";
import type { Queried, RobotSummary, Signal, StoredProgram } from "../../api/types.ts";
import type { Order } from "./runner.svelte.ts";

const FRAMES = ["0", "0", "0"];

/** The page, with a gateway that is heard and one robot that is read with this period. */
async function start() {
  vi.stubGlobal("location", { hash: "", pathname: "/", search: "", origin: "" });
  vi.stubGlobal("matchMedia", () => ({ matches: false, addEventListener: () => {} }));
  vi.resetModules();
  const answers: Record<string, Answer<unknown>> = {};
  vi.doMock("../../api/client.ts", () => ({
    goByClock: () => {},
    call: async (_method: string, path: string) => answers[path] ?? { kind: "unknown" },
    freshKey: () => "key",
    whenSignedOut: () => {},
  }));
  const { hall } = await import("../../state/hall.svelte.ts");
  const { axesOf, framesOf, agreedOf } = await import("./seen.ts");
  const { stops } = await import("../../stop/stops.ts");
  const { viewOf } = await import("../../robots/view.ts");
  const { lastLook } = await import("./last.ts");
  hall.isConnected = true;
  const robot = (period_ms: number, signals: Signal[] = VALUES) => {
    const summary = { name: "saw", link: "up" } as RobotSummary;
    hall.store.apply({ type: "snapshot", ...summary, period_ms, signals, epoch: 1, number: 1 } as never, hall.now());
    return viewOf(hall.store.robots.get("saw")!);
  };
  const frames = (signal: Partial<Signal>): void => {
    const signals = [{ address: "toolCoord", age_ms: 1, quality: "fresh", unit: null, value: FRAMES, ...signal }] as Signal[];
    answers["/v1/robots/saw/query?address=toolCoord"] = { kind: "ok", value: { signals, problems: [] } satisfies Queried };
  };
  const kept = (program: string): void => {
    answers["/v1/programs/p"] = { kind: "ok", value: { version: 1, program } as StoredProgram };
  };
  return { hall, axesOf, framesOf, agreedOf, stops, lastLook, robot, frames, kept, answers };
}

const signal = (address: string, value: Signal["value"], part: Partial<Signal> = {}): Signal => ({
  address,
  value,
  age_ms: 10,
  quality: "fresh",
  unit: null,
  ...part,
});
const VALUES = [signal("curMode", 7), signal("axis-0", 1), signal("axis-1", 2), signal("isMoving", false)];

beforeEach(() => vi.unstubAllGlobals());

test("where the arm stands is known only from axes that are all of now, whatever the period", async () => {
  const { axesOf, robot, hall } = await start();
  const now = 1_000_000;
  vi.spyOn(hall, "now").mockImplementation(() => now);
  expect(axesOf(robot(1_000))).toEqual([1, 2]);
  expect(axesOf(robot(200, [...VALUES, signal("axis-2", null, { quality: "none", age_ms: null })]))).toEqual([1, 2]);
  const stale = VALUES.map((one) => (one.address === "axis-1" ? { ...one, quality: "stale" as const } : one));
  expect(axesOf(robot(200, stale))).toBeNull();
  const gap = [signal("axis-0", 1), signal("axis-1", null, { quality: "none", age_ms: null }), signal("axis-2", 3)];
  expect(axesOf(robot(200, gap)), "an axis between others was not read").toBeNull();
  expect(axesOf(robot(200, []))).toBeNull();
  // The gateway calls these fresh: they may be as old as their period.
  const seldom = robot(10_000, VALUES.map((one) => ({ ...one, age_ms: 3_000 })));
  expect([axesOf(seldom), seldom.moving]).toEqual([null, null]);
});

test("tool and work frame that are old are no answer, and not untold", async () => {
  const { framesOf, frames, answers } = await start();
  frames({});
  expect(await framesOf("saw")).toBe(JSON.stringify(FRAMES));
  frames({ quality: "stale" });
  expect(await framesOf("saw")).toBeUndefined();
  frames({ quality: "none", value: null });
  expect(await framesOf("saw")).toBeNull();
  answers["/v1/robots/saw/query?address=toolCoord"] = { kind: "unknown" };
  expect(await framesOf("saw")).toBeUndefined();
});

test("nothing is sent unless the stored program and the frames are read again, and are as they were", async () => {
  const { lastLook, frames, kept, answers } = await start();
  const order: Order = { text: "a", kept: { name: "p", version: 1, sha256: "5e" } };
  const before = JSON.stringify(FRAMES);
  frames({});
  expect(await lastLook("saw", before, { text: "a" }), "a text is not kept").toBeNull();
  expect(await lastLook("saw", before, order), "the gateway does not answer").toBe("not_read");
  kept("a");
  expect(await lastLook("saw", before, order)).toBeNull();
  kept("b");
  expect(await lastLook("saw", before, order)).toBe("version");
  kept("a");
  frames({ value: ["1", "0", "0"] });
  expect(await lastLook("saw", before, order)).toBe("frames");
  expect(await lastLook("saw", before, { text: "a" })).toBe("frames");
  expect(await lastLook("saw", null, { text: "a" }), "they are told now").toBe("frames");
  frames({ quality: "stale" });
  expect(await lastLook("saw", before, order)).toBe("not_read");
  answers["/v1/robots/saw/query?address=toolCoord"] = { kind: "unknown" };
  expect(await lastLook("saw", before, { text: "a" })).toBe("not_read");
});

test("a stop of this page that is on its way counts, before the gateway tells of it", async () => {
  const { agreedOf, robot, stops } = await start();
  const view = robot(200);
  expect(agreedOf(view).isStopped).toBe(false);
  vi.stubGlobal("fetch", () => new Promise(() => {}));
  stops.one("other", { csrf: null, isLost: false });
  expect(agreedOf(view).isStopped).toBe(false);
  stops.one("saw", { csrf: null, isLost: false });
  expect([stops.of("saw")?.kind, agreedOf(view).isStopped]).toEqual(["sending", true]);
});
