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
