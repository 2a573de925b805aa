import { expect, test } from "vitest";
import type { StopState } from "./stop.ts";
import { AT_A_TIME, Stops, type Target, WITHOUT_LINK, type World } from "./stops.ts";

const BY = { csrf: null, isLost: false };
const STOPPED: StopState = { kind: "stopped", at: new Date(0), took: 1 };

interface Sent {
  robot: string;
  signal: AbortSignal | undefined;
  end(state: StopState): Promise<void>;
}

function start(): { stops: Stops; sent: Sent[]; later(): void; robots(): string[] } {
  const sent: Sent[] = [];
  let timers: (() => void)[] = [];
  const world: World = {
    stop: (robot, _csrf, tell, options) => {
      tell({ kind: "sending" });
      return new Promise<void>((done) => {
        const end = async (state: StopState): Promise<void> => {
          tell(state);
          done();
          await new Promise((next) => setTimeout(next));
        };
        options?.signal?.addEventListener("abort", () => void end({ kind: "not_confirmed", why: "given_up" }));
        sent.push({ robot, signal: options?.signal, end });
      });
    },
    after: (_ms, act) => {
      timers.push(act);
      return () => void (timers = timers.filter((one) => one !== act));
    },
  };
  const later = (): void => timers.splice(0).forEach((act) => act());
  return { stops: new Stops(world), sent, later, robots: () => sent.map(({ robot }) => robot) };
}

const linked = (robot: string, moves: boolean | null = true): Target => ({ robot, hasLink: true, moves });
const lost = (robot: string): Target => ({ robot, hasLink: false, moves: null });

test("those that move leave first, those without a link last and two at a time", async () => {
  const { stops, sent, robots } = start();
  stops.many([lost("x"), lost("y"), lost("z"), linked("c", false), linked("b", null), linked("a"), linked("d")], BY);
  expect(robots()).toEqual(["a", "d", "b", "c"]);
  expect(sent).toHaveLength(AT_A_TIME);
  for (const { end } of sent.slice(0, 3)) await end(STOPPED);
  expect(robots().slice(4)).toEqual(["x", "y"]);
  await sent[3]!.end(STOPPED);
  expect(robots().slice(4)).toHaveLength(WITHOUT_LINK);
  await sent[4]!.end({ kind: "not_confirmed", why: "not_stopped" });
  expect(robots().slice(4)).toEqual(["x", "y", "z"]);
});

test("no robot without a link is sent a stop while one with a link waits", async () => {
  const { stops, sent, robots } = start();
  const many = Array.from({ length: 6 }, (_, at) => linked(`a${at}`));
  stops.many([lost("x"), ...many], BY);
  await sent[0]!.end(STOPPED);
  await sent[1]!.end(STOPPED);
  expect(robots()).toEqual(many.map(({ robot }) => robot));
  stops.many([linked("late")], BY);
  await sent[2]!.end(STOPPED);
  expect(robots().at(-1)).toBe("late");
  await sent[3]!.end(STOPPED);
  expect(robots().at(-1)).toBe("x");
});

test("what waits says that it was not sent, and later what became of it", async () => {
  const { stops, sent, later } = start();
  stops.many([lost("x"), lost("y"), lost("z")], BY);
  expect([stops.of("x"), stops.of("z")]).toEqual([{ kind: "sending" }, { kind: "waiting" }]);
  later();
  expect(stops.of("z")).toEqual({ kind: "not_sent", why: "in_turn" });
  await sent[0]!.end({ kind: "not_confirmed", why: "not_stopped" });
  expect(stops.of("z")).toEqual({ kind: "sending" });
  expect(stops.isBusy).toBe(true);
  await sent[1]!.end(STOPPED);
  await sent[2]!.end(STOPPED);
  expect(stops.isBusy).toBe(false);
});

test("a single stop leaves at once, and robots without a link give up their connections for it", async () => {
  const { stops, sent, robots } = start();
  stops.many([lost("x"), lost("y"), lost("z")], BY);
  stops.one("a", BY);
  expect(robots()).toEqual(["x", "y", "a"]);
  expect(sent.map(({ signal }) => signal?.aborted)).toEqual([true, true, undefined]);
  await new Promise((next) => setTimeout(next));
  expect(robots(), "none takes the place of those that gave up").toEqual(["x", "y", "a"]);
  expect(stops.of("x")).toEqual({ kind: "not_confirmed", why: "given_up" });
  expect(stops.of("z")).toEqual({ kind: "not_sent", why: "given_up" });
});

test("a single stop is sent before stops that wait; stops of robots with a link go on", async () => {
  const { stops, sent, robots } = start();
  stops.many(["a", "b", "c", "d", "e", "f"].map((robot) => linked(robot)), BY);
  stops.one("f", BY);
  expect(robots()).toEqual(["a", "b", "c", "d", "f"]);
  await sent[0]!.end(STOPPED);
  expect(robots()).toEqual(["a", "b", "c", "d", "f", "e"]);
  await sent[1]!.end(STOPPED);
  expect(robots()).toHaveLength(6);
  expect(sent[2]!.signal?.aborted).toBe(false);
});

test("what an earlier stop says does not replace what the latest one says", async () => {
  const { stops, sent } = start();
  const gone = stops.show("a");
  stops.one("a", BY);
  stops.one("a", BY);
  await sent[1]!.end(STOPPED);
  await sent[0]!.end({ kind: "not_confirmed", why: "no_answer" });
  expect(stops.of("a")).toEqual(STOPPED);
  gone();
  expect(stops.of("a"), "the arm may move again when the page is opened again").toBeNull();
});

test("what is not proved stays until somebody has read it, also where no button says it", async () => {
  const { stops, sent } = start();
  const gone = stops.show("a");
  stops.one("a", BY);
  expect(stops.apart).toEqual([]);
  gone();
  expect(stops.apart).toEqual([{ robot: "a", state: { kind: "sending" } }]);
  stops.dismiss("a");
  expect(stops.apart).toHaveLength(1);
  await sent[0]!.end({ kind: "not_confirmed", why: "not_stopped" });
  expect(stops.apart).toEqual([{ robot: "a", state: { kind: "not_confirmed", why: "not_stopped" } }]);
  stops.dismiss("a");
  expect([stops.apart, stops.of("a")]).toEqual([[], null]);
  stops.one("a", BY);
  await sent[1]!.end(STOPPED);
  expect(stops.apart).toEqual([]);
});

test("a proved stop goes when it is cleared; what was not proved stays until it is read", async () => {
  const { stops, sent } = start();
  stops.show("a");
  stops.show("b");
  stops.one("a", BY);
  stops.one("b", BY);
  await sent[0]!.end(STOPPED);
  await sent[1]!.end({ kind: "not_confirmed", why: "not_stopped" });
  for (const robot of ["a", "b", "c"]) stops.cleared(robot, 0);
  expect([stops.of("a"), stops.of("b")?.kind, stops.of("c")]).toEqual([null, "not_confirmed", null]);
});

test("a proof from before the stop was cleared proves nothing of now; a later one does", async () => {
  const { stops, sent } = start();
  stops.show("a");
  stops.one("a", BY);
  stops.cleared("a", 5_000);
  await sent[0]!.end({ kind: "stopped", at: new Date(4_000), took: 1 });
  expect(stops.of("a")).toEqual({ kind: "not_confirmed", why: "cleared" });
  stops.one("a", BY);
  await sent[1]!.end({ kind: "stopped", at: new Date(6_000), took: 1 });
  expect(stops.of("a")?.kind).toBe("stopped");
});
