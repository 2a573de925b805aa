import { expect, test } from "vitest";
import { SOON, type StopState, type World, stop } from "./stop.ts";

const AT = new Date(0);

/** Runs a stop whose request ends like this, and whose timers are due if `waits`. */
async function told(respond: (init: RequestInit) => Promise<Response>, waits = false): Promise<StopState[]> {
  const states: StopState[] = [];
  let time = 0;
  const world: World = {
    fetch: (_path, init) => respond(init ?? {}),
    after: (_ms, act) => {
      if (waits) act();
      return () => {};
    },
    // The first look is at the begin.
    now: () => new Date(waits ? (time += 5_000) : 0),
  };
  await stop("press-4", "proof", (state) => states.push(state), world);
  return states;
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

test("what the gateway refused was not sent, nor what never reached it", async () => {
  for (const [status, code] of [
    [401, "no_session"],
    [403, "not_allowed"],
    [404, "no_such_robot"],
  ] as const) {
    expect((await told(answer(status, { code }))).at(-1)).toEqual({ kind: "not_sent", why: code });
  }
  const states = await told(() => Promise.reject(new TypeError("Failed to fetch")));
  expect(states).toEqual([{ kind: "sending" }, { kind: "not_sent", why: "no_gateway" }]);
});

test("a gateway that does not answer may have stopped the arm or not", async () => {
  const hangs = (init: RequestInit) =>
    new Promise<Response>((_, fail) => {
      if (init.signal?.aborted) fail(new DOMException("", "AbortError"));
    });
  const states = await told(hangs, true);
  expect(states).toEqual([
    { kind: "sending" },
    { kind: "not_confirmed", why: "no_answer" },
    { kind: "not_confirmed", why: "no_answer" },
  ]);
  expect(SOON).toBeLessThanOrEqual(3_000);
});

test("a connection that breaks while the answer is awaited may have carried the stop", async () => {
  const states = await told(() => Promise.reject(new TypeError("Failed to fetch")), true);
  expect(states.at(-1)).toEqual({ kind: "not_confirmed", why: "no_answer" });
});

test("the request has begun when the call returns, and names its robot safely", () => {
  let path = "";
  const world: World = {
    fetch: (to) => {
      path = String(to);
      return new Promise(() => {});
    },
    after: () => () => {},
    now: () => AT,
  };
  void stop("a/../b?c", null, () => {}, world);
  expect(path).toBe("/v1/robots/a%2F..%2Fb%3Fc/stop");
});
