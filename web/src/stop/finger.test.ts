import { expect, test } from "vitest";
import { Finger, REST, RUNS, SLIDE, type Touch } from "./finger.ts";

function start(): { finger: Finger; at(x?: number, y?: number, pointerId?: number): Touch; pass(ms: number): void; presses(): number } {
  let time = 1_000;
  let presses = 0;
  let timers: { at: number; act: () => void }[] = [];
  const finger = new Finger({
    after: (ms, act) => {
      const timer = { at: time + ms, act };
      timers.push(timer);
      return () => void (timers = timers.filter((one) => one !== timer));
    },
    press: () => void (presses += 1),
  });
  const pass = (ms: number): void => {
    time += ms;
    const due = timers.filter(({ at }) => at <= time);
    timers = timers.filter(({ at }) => at > time);
    for (const { act } of due) act();
  };
  const at = (clientX = 0, clientY = 0, pointerId = 1): Touch => ({ pointerId, clientX, clientY, timeStamp: time });
  return { finger, at, pass, presses: () => presses };
}

test("a tap presses once, and so does a finger that rests, before it is lifted", () => {
  const { finger, at, pass, presses } = start();
  finger.down(at());
  pass(80);
  finger.up(at(), true);
  pass(REST);
  expect(presses()).toBe(1);
  finger.down(at());
  pass(REST);
  expect(presses()).toBe(2);
  finger.up(at(), true);
  pass(REST);
  expect(presses()).toBe(2);
});

test("a finger that scrolls presses nothing, however late the page hears of the scroll", () => {
  for (const late of [0, 50, REST - 1]) {
    const { finger, at, pass, presses } = start();
    finger.down(at());
    pass(60);
    finger.move(at(0, SLIDE + 1));
    finger.cancel(at(0, SLIDE + 1));
    pass(late);
    finger.scrolled(at().timeStamp);
    pass(REST);
    expect(presses(), `${late} ms later`).toBe(0);
  }
});

test("a slide that scrolls nothing presses, on the button alone", () => {
  const { finger, at, pass, presses } = start();
  finger.down(at());
  finger.move(at(0, SLIDE + 8));
  pass(REST);
  expect(presses(), "it may be about to scroll").toBe(0);
  finger.up(at(0, SLIDE + 8), true);
  expect(presses()).toBe(1);
  finger.down(at());
  finger.move(at(SLIDE + 8));
  pass(REST);
  expect(presses(), "sideways nothing scrolls: it rests").toBe(2);
  finger.up(at(SLIDE + 8), true);
  finger.down(at());
  finger.up(at(900), false);
  pass(REST);
  expect(presses()).toBe(2);
  finger.down(at());
  finger.cancel(at(0, SLIDE + 1));
  pass(REST);
  expect(presses()).toBe(3);
});

test("a short touch holds a list that still runs, and a longer one presses", () => {
  const { finger, at, pass, presses } = start();
  finger.scrolled(at().timeStamp);
  pass(RUNS - 1);
  finger.down(at());
  pass(60);
  finger.up(at(), true);
  finger.scrolled(at().timeStamp);
  finger.down(at());
  finger.cancel(at());
  pass(REST);
  finger.scrolled(at().timeStamp);
  finger.down(at());
  pass(REST);
  expect(presses()).toBe(0);
  pass(REST);
  expect(presses()).toBe(1);
});

test("another finger ends no press, and what is dropped presses nothing", () => {
  const { finger, at, pass, presses } = start();
  finger.down(at());
  finger.cancel(at(0, 0, 2));
  finger.up(at(0, 0, 2), true);
  expect(presses()).toBe(0);
  finger.up(at(), true);
  expect(presses()).toBe(1);
  finger.down(at());
  finger.drop();
  pass(2 * REST);
  finger.up(at(), true);
  expect(presses()).toBe(1);
});

test("a finger on a button that goes away pressed it, unless it was about to scroll", () => {
  const { finger, at, pass, presses } = start();
  expect(finger.leave()).toBe(false);
  finger.down(at());
  pass(REST / 2);
  expect(finger.leave()).toBe(true);
  // It is said once, and the finger that is lifted afterwards adds nothing.
  expect(finger.leave()).toBe(false);
  finger.up(at(), true);
  pass(2 * REST);
  expect(presses()).toBe(0);
  finger.down(at());
  finger.move(at(0, SLIDE + 1));
  expect(finger.leave(), "it slid").toBe(false);
  finger.down(at());
  finger.move(at(0, SLIDE - 1));
  expect(finger.leave(), "it trembled").toBe(true);
  finger.down(at());
  finger.move(at(3 * SLIDE, 0));
  expect(finger.leave(), "sideways nothing scrolls").toBe(true);
  pass(RUNS);
  finger.scrolled(at().timeStamp);
  finger.down(at());
  expect(finger.leave(), "it held a list that ran").toBe(false);
  finger.down(at());
  pass(2 * REST);
  expect(presses(), "it pressed while it rested").toBe(1);
  expect(finger.leave()).toBe(false);
});
