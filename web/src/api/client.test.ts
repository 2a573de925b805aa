import { afterEach, expect, test, vi } from "vitest";
import { stops } from "../stop/stops.ts";
import { HOLDS, call, goByClock } from "./client.ts";

afterEach(() => vi.unstubAllGlobals());

test("beside a stop there is one question at a time, and what a person does does not wait", async () => {
  const sent: { path: string; answer(): void }[] = [];
  vi.stubGlobal("fetch", (path: string) => {
    return new Promise<Response>((done) => sent.push({ path, answer: () => done(Response.json({ confirmed: true, took_ms: 1 })) }));
  });
  const settled = (): Promise<void> => new Promise((next) => setTimeout(next));
  const paths = (): string[] => sent.map(({ path }) => path);
  for (const path of ["/1", "/2", "/3", "/4"]) void call("GET", path);
  await settled();
  expect(paths()).toEqual(["/1", "/2", "/3"]);
  stops.one("saw", { csrf: null, isLost: false });
  expect(paths().at(-1)).toBe("/v1/robots/saw/stop");
  void call("POST", "/5");
  expect(paths().at(-1)).toBe("/5");
  sent[0]?.answer();
  sent[1]?.answer();
  await settled();
  expect(paths()).not.toContain("/4");
  sent[2]?.answer();
  await settled();
  expect(paths().at(-1)).toBe("/4");
  void call("GET", "/6");
  await settled();
  expect(paths()).not.toContain("/6");
  sent[3]?.answer();
  await settled();
  expect(paths().at(-1)).toBe("/6");
});

test("an order has a key of its own and says until when it holds, and a question has neither", async () => {
  const sent: Headers[] = [];
  vi.stubGlobal("fetch", (_path: string, init: RequestInit) => {
    sent.push(new Headers(init.headers));
    return Promise.resolve(Response.json({}));
  });
  const now = Date.parse("2026-11-27T18:06:17Z");
  await call("POST", "/1");
  goByClock(() => now);
  await call("POST", "/2");
  await call("POST", "/3", { idempotencyKey: "mine" });
  await call("GET", "/4");
  goByClock(() => null);
  const [early, first, own, question] = sent;
  expect(early?.get("Valid-Until"), "the clock of the gateway is not known").toBeNull();
  expect(first?.get("Valid-Until")).toBe(new Date(now + HOLDS).toISOString());
  expect(first?.get("Idempotency-Key")).toMatch(/^[0-9a-f]{32}$/);
  expect(first?.get("Idempotency-Key")).not.toBe(early?.get("Idempotency-Key"));
  expect(own?.get("Idempotency-Key")).toBe("mine");
  expect([question?.get("Idempotency-Key"), question?.get("Valid-Until")]).toEqual([null, null]);
});

test("an answer that is cut off, or of somebody in between, is no answer", async () => {
  for (const body of ['{"alarms":[', "<html>Sign in to the network</html>"]) {
    vi.stubGlobal("fetch", () => Promise.resolve(new Response(body, { status: 200 })));
    expect(await call("GET", "/v1/alarms")).toEqual({ kind: "unknown" });
    expect(await call("POST", "/v1/robots/saw/lease")).toEqual({ kind: "unknown" });
  }
});
