import { expect, test } from "vitest";
import { Link, QUIET, type Reader, SILENCE, type Socket, type World } from "./socket.ts";

/** A world whose time is moved by the test. */
class Fake implements World {
  time = 0;
  opened: { path: string; socket: FakeSocket }[] = [];
  signedIn: boolean | null = true;
  private timers: { at: number; act: () => void }[] = [];

  open(path: string): Socket {
    const socket = new FakeSocket();
    this.opened.push({ path, socket });
    return socket;
  }

  now(): number {
    return this.time;
  }

  after(ms: number, act: () => void): () => void {
    const timer = { at: this.time + ms, act };
    this.timers.push(timer);
    return () => (this.timers = this.timers.filter((one) => one !== timer));
  }

  /** How late messages come; `null` if that is not known. */
  delay: number | null = 0;

  left(_time: number, now: number): number | null {
    return this.delay === null ? null : now - this.delay;
  }

  isSignedIn(): Promise<boolean | null> {
    return Promise.resolve(this.signedIn);
  }

  /** Lets time pass: timers are called when they are due. */
  async pass(ms: number): Promise<void> {
    const end = this.time + ms;
    // What was asked before has its answer first.
    await new Promise((next) => setTimeout(next));
    for (;;) {
      const next = this.timers.filter((timer) => timer.at <= end).sort((a, b) => a.at - b.at)[0];
      if (next === undefined) break;
      this.timers = this.timers.filter((timer) => timer !== next);
      this.time = Math.max(this.time, next.at);
      next.act();
      await Promise.resolve();
      await Promise.resolve();
    }
    this.time = end;
  }

  get last(): FakeSocket {
    return this.opened.at(-1)!.socket;
  }
}

class FakeSocket implements Socket {
  isClosed = false;
  message: (event: { data: unknown }) => void = () => {};
  private closed: (event: { code: number }) => void = () => {};

  addEventListener(kind: "message", act: (event: { data: unknown }) => void): void;
  addEventListener(kind: "close", act: (event: { code: number }) => void): void;
  addEventListener(kind: string, act: (event: never) => void): void {
    if (kind === "message") this.message = act as typeof this.message;
    else this.closed = act as typeof this.closed;
  }

  say(message: object): void {
    this.message({ data: JSON.stringify(message) });
  }

  end(code: number): void {
    this.closed({ code });
  }

  close(): void {
    this.isClosed = true;
  }
}

interface Started {
  world: Fake;
  told: (number | null | "out" | "forget")[];
  link: Link;
  messages: string[];
  quiet: (number | null)[];
  hangs: boolean[];
  slow: boolean[];
  /** When each message came, or left the gateway. */
  ats: number[];
}

function start(): Started {
  const world = new Fake();
  const told: (number | null | "out" | "forget")[] = [];
  const messages: string[] = [];
  const quiet: (number | null)[] = [];
  const hangs: boolean[] = [];
  const [slow, ats]: [boolean[], number[]] = [[], []];
  let resume: string | null = null;
  const reader: Reader = {
    message: (sent, at) => {
      messages.push(sent.type);
      ats.push(at);
      resume = sent.resume ?? resume;
      if (sent.type === "events_lost") link.again();
    },
    state: (heard, isSilent) => {
      told.push(heard);
      hangs.push(isSilent);
    },
    quiet: (heard, isSlow) => {
      if (quiet.at(-1) !== heard) quiet.push(heard);
      slow.push(isSlow);
    },
    signedOut: () => told.push("out"),
    resume: () => resume,
    forgetResume: () => {
      resume = null;
      told.push("forget");
    },
  };
  const link: Link = new Link(world, reader);
  link.start();
  return { world, told, link, messages, quiet, hangs, slow, ats };
}

const ALIVE = { type: "alive", time: "2026-11-25T06:00:00.000000Z" };

test("it goes on where it was lost, and waits longer each time", async () => {
  const { world, told } = start();
  expect(world.opened[0]?.path).toBe("/v1/live?events=true&alive=true");
  world.last.say({ type: "removed", robot: "saw", resume: "7-1" });
  expect(told).toEqual([null]);
  world.signedIn = null;
  world.last.end(1006);
  expect(told).toEqual([null, 0]);
  const waits: number[] = [];
  for (let at = 0; at < 6; at += 1) {
    const before = { time: world.time, count: world.opened.length };
    while (world.opened.length === before.count) await world.pass(100);
    waits.push(world.time - before.time);
    expect(world.opened.at(-1)?.path).toBe("/v1/live?events=true&alive=true&resume=7-1");
    world.last.end(1006);
    await world.pass(0);
  }
  expect(waits).toEqual([500, 1000, 2000, 4000, 5000, 5000]);
  while (world.last === world.opened[6]?.socket) await world.pass(100);
  world.last.say(ALIVE);
  expect(told).toEqual([null, 0, null]);
});

test("10 s of silence is a lost gateway, also while the connection stays open", async () => {
  const { world, told, hangs } = start();
  world.last.say(ALIVE);
  await world.pass(5_000);
  world.last.say(ALIVE);
  await world.pass(SILENCE);
  expect(told).toEqual([null]);
  const silent = world.last;
  await world.pass(1_000);
  expect(told).toEqual([null, 5_000]);
  expect(hangs).toEqual([false, true]);
  expect(silent.isClosed).toBe(true);
  // What the old connection still says does not count.
  silent.say(ALIVE);
  expect(told).toEqual([null, 5_000]);
  await world.pass(1_000);
  expect(world.opened).toHaveLength(2);
  // The gateway that hung ends: that is told too, and of when what was told is stays.
  world.signedIn = null;
  world.last.end(1006);
  expect([told, hangs]).toEqual([[null, 5_000, 5_000], [false, true, false]]);
});

test("after 4 s of silence what was told is old, until something comes", async () => {
  const { world, told, quiet } = start();
  world.last.say(ALIVE);
  await world.pass(2_000);
  world.last.say(ALIVE);
  await world.pass(QUIET - 1);
  expect(quiet).toEqual([]);
  await world.pass(250);
  expect([quiet, told]).toEqual([[2_000], [null]]);
  world.last.say(ALIVE);
  expect([quiet, told]).toEqual([[2_000, null], [null]]);
  expect(QUIET).toBe(4_000);
});

test("messages that come late do not make what they tell new, and those of which that is not known neither", async () => {
  const { world, quiet, slow, told, ats } = start();
  world.last.say(ALIVE);
  for (world.delay = 1_000; world.time < 10_000; ) {
    await world.pass(2_000);
    world.last.say(ALIVE);
  }
  expect(quiet).toEqual([]);
  world.delay = 8_000;
  for (let at = 0; at < 3; at += 1) {
    await world.pass(2_000);
    world.last.say(ALIVE);
  }
  // The last one that was not late left at 9 s.
  expect([world.time, quiet, slow.at(-1), ats.at(-1)]).toEqual([16_000, [9_000], true, 9_000]);
  await world.pass(2_000);
  world.last.say(ALIVE);
  expect([quiet, ats.at(-1)]).toEqual([[9_000, 10_000], 10_000]);
  world.delay = null;
  await world.pass(2_000);
  world.last.say(ALIVE);
  expect(quiet).toEqual([9_000, 10_000]);
  // It speaks, so the connection is not given up.
  expect([told, world.opened.length]).toEqual([[null], 1]);
  world.delay = 0;
  world.last.say(ALIVE);
  expect([quiet, ats.at(-1)]).toEqual([[9_000, 10_000, null], world.time]);
});

test("a connection whose first message comes late tells of when the page asked for it, at the earliest", async () => {
  const { world, quiet, ats } = start();
  world.delay = null;
  await world.pass(1_000);
  world.last.say({ type: "removed", robot: "saw", resume: "7-1" });
  expect([quiet, ats]).toEqual([[], [1_000]]);
  world.last.end(1006);
  await world.pass(500);
  await world.pass(8_000);
  world.last.say({ type: "removed", robot: "saw", resume: "7-1" });
  expect([quiet.at(-1), ats.at(-1)]).toEqual([1_500, 1_500]);
});

test("messages that waited while the browser stood still are old before a timer looks", () => {
  const { world, link, quiet, ats } = start();
  world.last.say(ALIVE);
  world.time = 20_000;
  expect(link.old()).toBe(0);
  world.delay = 19_000;
  world.last.say(ALIVE);
  expect([quiet, ats.at(-1)]).toEqual([[0, 1_000], 1_000]);
  world.delay = 100;
  world.last.say(ALIVE);
  expect([quiet, link.old()]).toEqual([[0, 1_000, null], null]);
  // The computer slept, and the page's clock with it.
  link.slept(60_000);
  expect(quiet.at(-1)).toBe(-40_100);
});

test("a connection that never says anything is tried again", async () => {
  const { world, told } = start();
  await world.pass(SILENCE + 2_000);
  expect([told, world.opened.length]).toEqual([[0], 2]);
});

test("the end of the session ends it", async () => {
  const { world, told } = start();
  world.last.say(ALIVE);
  world.last.end(1008);
  await world.pass(60_000);
  expect([told, world.opened.length]).toEqual([[null, 0, "out"], 1]);
});

test("a refused connection asks why: signed out, or a place that the gateway does not know", async () => {
  const { world, told } = start();
  world.last.end(1006);
  await world.pass(600);
  expect([told, world.opened.length]).toEqual([[0, "forget"], 2]);
  world.signedIn = false;
  world.last.end(1006);
  await world.pass(60_000);
  expect([told, world.opened.length]).toEqual([[0, "forget", "out"], 2]);
});

test("it tries at once when the page is shown again, and never twice at a time", async () => {
  const { world, link } = start();
  world.last.say(ALIVE);
  link.hurry();
  expect(world.opened).toHaveLength(1);
  world.last.end(1006);
  link.hurry();
  expect(world.opened).toHaveLength(2);
  await world.pass(2_000);
  expect(world.opened).toHaveLength(2);
  link.end();
  await world.pass(60_000);
  expect(world.opened).toHaveLength(2);
  expect(world.last.isClosed).toBe(true);
});

test("messages of a newer gateway are passed over", () => {
  const { world, messages } = start();
  world.last.say({ type: "from_the_future" });
  world.last.say(ALIVE);
  expect(messages).toEqual(["alive"]);
});

test("after a lost connection what was told before is old until all robots had their turn", async () => {
  const { world, quiet, ats } = start();
  world.last.say({ type: "change", resume: "1-1" });
  await world.pass(1_000);
  world.last.end(1006);
  await world.pass(15_000);
  const again = world.last;
  again.say({ type: "change" });
  expect(quiet.at(-1), "the first message is of one robot").toBe(0);
  expect(ats.at(-1), "what it says itself left after the page asked").toBeGreaterThan(10_000);
  await world.pass(3_000);
  again.say({ type: "alive", time: "", passed_ms_ago: null });
  expect(quiet.at(-1)).toBe(0);
  again.say({ type: "change", resume: "1-9" });
  expect(quiet.at(-1), "the pass is at its end, and began after the page asked").toBeGreaterThan(10_000);
  again.say({ type: "alive", time: "", passed_ms_ago: 20 });
  expect(quiet.at(-1)).toBe(null);
});

test("a hall in which nothing changed has no message at the end of its pass: alive says that it is over", async () => {
  const { world, quiet } = start();
  world.last.say({ type: "change", resume: "1-1" });
  world.last.end(1006);
  await world.pass(15_000);
  world.last.say({ type: "alive", time: "", passed_ms_ago: 0 });
  expect(quiet.at(-1)).toBe(null);
});

test("where alive overtakes the values, they are as old as the last look at all robots", async () => {
  const { world, quiet, link } = start();
  world.last.say({ type: "change", resume: "1-1" });
  for (let seconds = 0; seconds < 10; seconds += 2) {
    await world.pass(2_000);
    world.last.say({ type: "alive", time: "", passed_ms_ago: 7_000 });
  }
  expect(quiet.at(-1)).toBe(3_000);
  expect(link.old()).toBe(3_000);
  world.last.say({ type: "alive", time: "", passed_ms_ago: 20 });
  expect(quiet.at(-1)).toBe(null);
});

test("after something was missed it connects anew, and begins with all robots", async () => {
  const { world, link, messages } = start();
  world.last.say({ type: "change", resume: "1-1" });
  const first = world.last;
  link.again();
  expect(first.isClosed).toBe(true);
  expect(world.opened.at(-1)!.path).not.toContain("resume");
  expect(messages.at(-1), "robots that are not told of any more are gone").toBe("reset");
});

test("what stands behind a message that made it connect anew says nothing of the new connection", async () => {
  const { world, quiet, messages } = start();
  world.last.say({ type: "change", resume: "1-1" });
  await world.pass(3_000);
  const first = world.last;
  // The worker hands several messages over at once.
  first.message({ data: [{ type: "events_lost", resume: "1-2" }, { type: "change", resume: "1-3" }] });
  expect(messages.slice(-2), "then all robots are in doubt").toEqual(["events_lost", "reset"]);
  expect(world.opened.at(-1)!.path).not.toContain("resume");
  await world.pass(2_000);
  world.last.say({ type: "event" });
  expect(quiet.at(-1), "no robot had its turn yet").toBe(0);
  world.last.say({ type: "change", resume: "1-9" });
  expect(quiet.at(-1)).toBe(null);
});
