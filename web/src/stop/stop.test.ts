import { afterEach, expect, test, vi } from "vitest";
import { AGAIN, SOON, type StopState, type World, goBy, stop } from "./stop.ts";

const AT = new Date(0);

afterEach(() => vi.unstubAllGlobals());

/** A world whose time the test moves: timers are called when they are due, unless they were cancelled. */
class Fake implements World {
  time = 0;
  private timers: { at: number; act: () => void }[] = [];

  constructor(readonly respond: (init: RequestInit, world: Fake) => Promise<Response>) {}

  readonly fetch: World["fetch"] = (_path, init) => this.respond(init ?? {}, this);

  after(ms: number, act: () => void): () => void {
    const timer = { at: this.time + ms, act };
    this.timers.push(timer);
    return () => void (this.timers = this.timers.filter((one) => one !== timer));
  }

  now(): number {
    return this.time;
  }

  hallTime(): Date {
    return AT;
  }

  pass(ms: number): void {
    this.time += ms;
    const due = this.timers.filter(({ at }) => at <= this.time);
    this.timers = this.timers.filter(({ at }) => at > this.time);
    for (const { act } of due) act();
  }
}

/** Runs a stop whose request ends like this. Timers that are left are called at the end. */
async function told(respond: Fake["respond"], isLost = false): Promise<StopState[]> {
  const states: StopState[] = [];
  const world = new Fake(respond);
  let isOver = false;
  void stop("press-4", "proof", (state) => states.push(state), { world, isLost }).then(() => (isOver = true));
  for (let steps = 0; steps < 1_000 && !isOver; steps += 1) {
    await new Promise((next) => setTimeout(next));
    if (!isOver) world.pass(100);
  }
  world.pass(60_000);
  return states;
}

/** Fails as `fetch` does. */
const broken = (): Promise<Response> => Promise.reject(new TypeError("Failed to fetch"));

/** Hangs for so long after the time when it was sent, then ends like this. */
function late(ms: number, then: () => Promise<Response>) {
  return async (_init: RequestInit, world: Fake): Promise<Response> => {
    await Promise.resolve();
    world.pass(ms);
    return then();
  };
}

const answer = (status: number, body: object) => () => Promise.resolve(Response.json(body, { status }));

test("it says that it sends before it sends, and `stopped` only if that was proved", async () => {
  const states = await told((init) => {
    expect(init).toMatchObject({ method: "POST", headers: { "X-CSRF-Token": "proof" } });
    return answer(200, { confirmed: true, took_ms: 51.7 })();
  });
  expect(states).toEqual([{ kind: "sending" }, { kind: "stopped", at: AT, took: 51.7 }]);
  expect((await told(answer(200, {}))).at(-1)).toEqual({ kind: "not_confirmed", why: "unknown" });
  expect((await told(answer(504, { code: "not_stopped" }))).at(-1)).toEqual({
    kind: "not_confirmed",
    why: "not_stopped",
  });
  expect((await told(() => Promise.resolve(new Response("<html>", { status: 502 })))).at(-1)?.kind).toBe("not_confirmed");
});

test("what the gateway refused was not sent", async () => {
  for (const [status, code] of [
    [401, "no_session"],
    [403, "not_allowed"],
    [404, "no_such_robot"],
  ] as const) {
    expect((await told(answer(status, { code }))).at(-1)).toEqual({ kind: "not_sent", why: code });
  }
});

test("a stop that was refused for the proof of another session is sent once more with the present one", async () => {
  const sent: string[] = [];
  const gateway =
    (proofs: (string | null)[]): Fake["respond"] =>
    (init) => {
      if (init.method !== "POST") {
        const csrf = proofs.shift() ?? null;
        return csrf === null ? answer(401, { code: "no_session" })() : answer(200, { csrf })();
      }
      const proof = (init.headers as Record<string, string>)["X-CSRF-Token"] ?? "";
      sent.push(proof);
      return proof === "new" ? answer(200, { confirmed: true, took_ms: 9 })() : answer(403, { code: "bad_csrf" })();
    };
  expect((await told(gateway(["new"]))).at(-1)).toEqual({ kind: "stopped", at: AT, took: 9 });
  expect(sent).toEqual(["proof", "new"]);
  // Once: not with the same proof, and not for ever.
  for (const proofs of [["proof"], ["other", "new"], [null]]) {
    expect((await told(gateway(proofs))).at(-1)).toEqual({ kind: "not_sent", why: "bad_csrf" });
  }
  expect(sent).toEqual(["proof", "new", "proof", "proof", "other", "proof"]);
});

test("a request that fails may have been sent, unless the gateway was lost before and it fails at once", async () => {
  expect(await told(broken)).toEqual([{ kind: "sending" }, { kind: "not_confirmed", why: "no_gateway" }]);
  expect(await told(broken, true)).toEqual([{ kind: "sending" }, { kind: "not_sent", why: "no_gateway" }]);
  expect((await told(late(2_000, broken), true)).at(-1)).toEqual({ kind: "not_confirmed", why: "no_gateway" });
});

test("a gateway that does not answer may have stopped the arm or not", async () => {
  const states: StopState[] = [];
  const hangs = (init: RequestInit): Promise<Response> =>
    new Promise((_, fail) => init.signal?.addEventListener("abort", () => fail(new DOMException("", "AbortError"))));
  const world = new Fake(hangs);
  const ended = stop("press-4", null, (state) => states.push(state), { world, isLost: true });
  world.pass(SOON);
  expect(states.at(-1)).toEqual({ kind: "not_confirmed", why: "no_answer" });
  world.pass(60_000);
  await ended;
  expect(states.at(-1)).toEqual({ kind: "not_confirmed", why: "no_answer" });
  expect(SOON).toBeLessThanOrEqual(3_000);
});

test("a stop that is given up for another one may have been sent", async () => {
  const states: StopState[] = [];
  const abort = new AbortController();
  const hangs = (init: RequestInit): Promise<Response> =>
    new Promise((_, fail) => init.signal?.addEventListener("abort", () => fail(new DOMException("", "AbortError"))));
  const world = new Fake(hangs);
  const ended = stop("press-4", null, (state) => states.push(state), { world, signal: abort.signal });
  abort.abort();
  await ended;
  expect(states.at(-1)).toEqual({ kind: "not_confirmed", why: "given_up" });
});

test("a late proof takes the place of NOT CONFIRMED, and NOT CONFIRMED never that of a proof", async () => {
  const proof = answer(200, { confirmed: true, took_ms: 9 });
  const kinds = (states: StopState[]): string[] => states.map(({ kind }) => kind);
  expect(kinds(await told(proof))).toEqual(["sending", "stopped"]);
  expect(kinds(await told(late(SOON, proof)))).toEqual(["sending", "not_confirmed", "stopped"]);
});

test("the request has begun when the call returns, and names its robot safely", () => {
  let path = "";
  const world: World = {
    fetch: (to) => {
      path = String(to);
      return new Promise(() => {});
    },
    after: () => () => {},
    now: () => 0,
    hallTime: () => AT,
  };
  void stop("a/../b?c", null, () => {}, { world });
  expect(path).toBe("/v1/robots/a%2F..%2Fb%3Fc/stop");
});

test("a stop is told with the time of the hall, whatever the clock of the browser shows", async () => {
  vi.stubGlobal("fetch", () => Promise.resolve(Response.json({ confirmed: true, took_ms: 9 })));
  const inHall = new Date("2026-11-25T06:00:00Z");
  goBy(() => inHall);
  const states: StopState[] = [];
  await stop("press-4", null, (state) => states.push(state));
  expect(states.at(-1)).toEqual({ kind: "stopped", at: inHall, took: 9 });
});

test("a stop without an answer is sent again, and the first proof counts", async () => {
  const world = new Fake(() => Promise.resolve(new Response()));
  const sent: number[] = [];
  // The first connection is dead. The second request gets an answer.
  const dead = (init: RequestInit): Promise<Response> =>
    new Promise((_, fail) => init.signal?.addEventListener("abort", () => fail(new DOMException("", "AbortError"))));
  const fetch: World["fetch"] = (_path, init) => {
    sent.push(world.time);
    return sent.length === 1 ? dead(init ?? {}) : answer(200, { confirmed: true, took_ms: 9, seen_at: "2026-11-25T06:00:08.9Z" })();
  };
  const states: StopState[] = [];
  const outside: World = { fetch, after: world.after.bind(world), now: () => world.time, hallTime: () => AT };
  const ended = stop("press-4", null, (state) => states.push(state), { world: outside });
  world.pass(AGAIN[0]!);
  await ended;
  expect(sent).toEqual([0, AGAIN[0]]);
  expect(states).toEqual([{ kind: "sending" }, { kind: "stopped", at: new Date("2026-11-25T06:00:08.9Z"), took: 9 }]);
  world.pass(60_000);
  expect(sent, "after the proof nothing is sent").toHaveLength(2);
});

test("a later request that is refused does not prove that an earlier one was refused too", async () => {
  const world = new Fake(() => Promise.resolve(new Response()));
  let count = 0;
  const fetch: World["fetch"] = () => ((count += 1) === 1 ? broken() : answer(401, { code: "no_session" })());
  const states: StopState[] = [];
  const outside: World = { fetch, after: world.after.bind(world), now: () => world.time, hallTime: () => AT };
  let isOver = false;
  void stop("press-4", null, (state) => states.push(state), { world: outside }).then(() => (isOver = true));
  for (let steps = 0; steps < 100 && !isOver; steps += 1) {
    await new Promise((next) => setTimeout(next));
    world.pass(100);
  }
  expect(isOver).toBe(true);
  expect(states.map(({ kind }) => kind)).not.toContain("not_sent");
  expect(states.at(-1)).toEqual({ kind: "not_confirmed", why: "no_session" });
});

test("where connections are few, a stop that is sent again gives up the request before", async () => {
  const world = new Fake(() => Promise.resolve(new Response()));
  const signals: AbortSignal[] = [];
  const fetch: World["fetch"] = (_path, init) => {
    signals.push(init?.signal as AbortSignal);
    if (signals.length > 1) return answer(200, { confirmed: true, took_ms: 9, seen_at: "2026-11-25T06:00:08Z" })();
    return new Promise((_, fail) => init?.signal?.addEventListener("abort", () => fail(new DOMException("", "AbortError"))));
  };
  const states: StopState[] = [];
  const outside: World = { fetch, after: world.after.bind(world), now: () => world.time, hallTime: () => AT };
  const ended = stop("press-4", null, (state) => states.push(state), { world: outside, again: [2_000], atATime: 1 });
  world.pass(2_000);
  expect(signals.map(({ aborted }) => aborted)).toEqual([true, false]);
  await ended;
  expect(states.map(({ kind }) => kind)).toEqual(["sending", "stopped"]);
});

test("a stop that is given up between two requests has ended", async () => {
  const world = new Fake(broken);
  const abort = new AbortController();
  const ended = stop("press-4", null, () => {}, { world, signal: abort.signal });
  await new Promise((next) => setTimeout(next));
  abort.abort();
  await ended;
});
