import { expect, test } from "vitest";
import { followZone } from "./zone.ts";

/** A world whose time is moved by the test. */
function world(answers: (string | null)[]) {
  let timers: { at: number; act: () => void }[] = [];
  let time = 0;
  const asked: number[] = [];
  const fake = {
    isUsed: true,
    asked,
    read: () => {
      asked.push(time);
      return Promise.resolve(answers.shift() ?? null);
    },
    after: (ms: number, act: () => void) => {
      const timer = { at: time + ms, act };
      timers.push(timer);
      return () => void (timers = timers.filter((one) => one !== timer));
    },
    async pass(ms: number): Promise<void> {
      for (const end = time + ms; ; ) {
        await new Promise((next) => setTimeout(next));
        const next = timers.filter(({ at }) => at <= end).sort((a, b) => a.at - b.at)[0];
        time = next?.at ?? end;
        if (next === undefined) return;
        timers = timers.filter((one) => one !== next);
        next.act();
      }
    },
  };
  return fake;
}

test("the zone is asked for until it is known, and again while somebody uses the page", async () => {
  const of = world([null, null, "Asia/Shanghai", "Asia/Shanghai", "Europe/Berlin"]);
  const told: (string | null)[] = [];
  const end = followZone(of, (zone) => told.push(zone));
  await of.pass(4_000);
  expect([of.asked, told]).toEqual([[0, 2_000, 4_000], [null, null, "Asia/Shanghai"]]);
  await of.pass(60_000);
  // Questions keep a session open: without a person at the page none is asked.
  of.isUsed = false;
  await of.pass(600_000);
  expect(of.asked).toHaveLength(4);
  of.isUsed = true;
  await of.pass(60_000);
  expect(told.slice(2)).toEqual(["Asia/Shanghai", "Asia/Shanghai", "Europe/Berlin"]);
  // Without an answer the zone stays.
  await of.pass(60_000);
  expect(told).toHaveLength(5);
  end();
  const count = of.asked.length;
  await of.pass(600_000);
  expect(of.asked).toHaveLength(count);
});
