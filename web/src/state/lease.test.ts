import { expect, test, vi } from "vitest";
import { HIDDEN, lease } from "./lease.svelte.ts";

test("that a lease has ended is said on the page of its robot alone", async () => {
  const held = { lease: { number: 4, key: "k" } };
  vi.stubGlobal("fetch", () => Promise.resolve(Response.json(held)));
  await lease.take("saw");
  expect([lease.robot, lease.ended]).toEqual(["saw", null]);
  lease.lost();
  expect([lease.robot, lease.ended]).toEqual([null, "saw"]);
  await lease.take("press");
  expect(lease.ended).toBeNull();
  vi.useFakeTimers();
  lease.visible(false);
  vi.advanceTimersByTime(HIDDEN);
  expect([lease.robot, lease.ended]).toEqual([null, "press"]);
  // Without a lease, nothing ends.
  lease.ended = null;
  lease.visible(false);
  vi.advanceTimersByTime(HIDDEN);
  lease.lost();
  expect(lease.ended).toBeNull();
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

/** A gateway that answers when the test says so. Returns what was asked of it. */
function slowGateway(): { asked: string[]; answer(): void } {
  const asked: string[] = [];
  const waiting: (() => void)[] = [];
  vi.stubGlobal("fetch", (path: string, { method }: RequestInit) => {
    asked.push(`${method} ${path.split("/")[3]}`);
    if (method !== "POST") return Promise.resolve(Response.json({}));
    return new Promise((next) => waiting.push(() => next(Response.json({ lease: { number: asked.length, key: "k" } }))));
  });
  return { asked, answer: () => waiting.shift()?.() };
}

test("a lease that comes late is given back if the page was left, or asked for another robot", async () => {
  const gateway = slowGateway();
  const taken = lease.take("saw");
  await vi.waitFor(() => expect(gateway.asked).toEqual(["POST saw"]));
  lease.leave();
  gateway.answer();
  await taken;
  expect([lease.robot, gateway.asked]).toEqual([null, ["POST saw", "DELETE saw"]]);

  const first = lease.take("saw");
  await vi.waitFor(() => expect(gateway.asked).toHaveLength(3));
  const second = lease.take("press");
  await vi.waitFor(() => expect(gateway.asked).toHaveLength(4));
  gateway.answer();
  await first;
  expect(lease.robot, "the first is given back").toBeNull();
  gateway.answer();
  await second;
  expect([lease.robot, gateway.asked.slice(2)]).toEqual(["press", ["POST saw", "POST press", "DELETE saw"]]);
  await lease.give();
  vi.unstubAllGlobals();
});

test("a lease that comes while the page is hidden is given back", async () => {
  const gateway = slowGateway();
  vi.stubGlobal("document", { visibilityState: "visible" });
  const taken = lease.take("saw");
  await vi.waitFor(() => expect(gateway.asked).toHaveLength(1));
  vi.stubGlobal("document", { visibilityState: "hidden" });
  gateway.answer();
  await taken;
  expect([lease.robot, lease.ended, gateway.asked]).toEqual([null, "saw", ["POST saw", "DELETE saw"]]);
  vi.unstubAllGlobals();
});

test("a gateway that has too much to do for a renewal is asked again, and the lease goes on", async () => {
  vi.useFakeTimers();
  const answers = [200, 429, 200, 409];
  vi.stubGlobal("fetch", () => {
    const status = answers.shift() ?? 200;
    const body = status === 200 ? { lease: { number: 4, key: "k" } } : { code: "leased", message: "" };
    return Promise.resolve(Response.json(body, { status }));
  });
  await lease.take("saw");
  const robots: (string | null)[] = [];
  for (let count = 0; count < 3; count += 1) {
    await vi.advanceTimersByTimeAsync(5_000);
    robots.push(lease.robot);
  }
  expect(robots).toEqual(["saw", "saw", null]);
  vi.useRealTimers();
  vi.unstubAllGlobals();
});
