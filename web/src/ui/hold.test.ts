import { expect, test } from "vitest";
import { AGAIN, GAP, HOLD, Holding, type Lack, SETTLE } from "./hold.ts";

function start(): { hold: Holding; pass(ms: number): void; acted(): number; isHeld(): boolean; lack(): Lack | null; leave(): void; now(): number; press(): void } {
  let time = 0;
  let acted = 0;
  let isHeld = false;
  let lack: Lack | null = null;
  let isAttended = true;
  let timers: { at: number; act: () => void }[] = [];
  const hold = new Holding({
    now: () => time,
    after: (ms, act) => {
      const timer = { at: time + ms, act };
      timers.push(timer);
      return () => void (timers = timers.filter((one) => one !== timer));
    },
    isAttended: () => isAttended,
    act: () => void (acted += 1),
    held: (is) => void (isHeld = is),
    lacks: (what) => void (lack = what),
  });
  const pass = (ms: number): void => {
    time += ms;
    const due = timers.filter(({ at }) => at <= time);
    timers = timers.filter(({ at }) => at > time);
    for (const { act } of due) act();
  };
  // The button is there for a while.
  pass(SETTLE);
  /** A press of a key that ends at once. */
  const press = (): void => {
    hold.keyDown("Enter", false, time);
    hold.keyUp("Enter", time);
  };
  return { hold, pass, press, acted: () => acted, isHeld: () => isHeld, lack: () => lack, leave: () => void (isAttended = false), now: () => time };
}

const finger = (pointerId: number, isPrimary = true) => ({ pointerId, isPrimary, button: 0 });

test("it acts once after it was held, and not after a shorter press", () => {
  const { hold, pass, acted, isHeld } = start();
  hold.down(finger(1));
  pass(HOLD - 1);
  hold.up(1);
  pass(HOLD);
  expect([acted(), isHeld()]).toEqual([0, false]);
  hold.down(finger(2));
  expect(isHeld()).toBe(true);
  pass(HOLD);
  expect([acted(), isHeld()]).toEqual([1, false]);
  hold.up(2);
  pass(HOLD);
  expect(acted()).toBe(1);
});

test("a press that does not act says what it lacks, until it acts or for some seconds", () => {
  const { hold, pass, acted, lack, now } = start();
  hold.down(finger(1));
  pass(HOLD / 2);
  hold.up(1);
  expect(lack()).toBe("longer");
  hold.down(finger(2));
  expect(lack()).toBeNull();
  pass(HOLD);
  hold.up(2);
  expect([acted(), lack()]).toEqual([1, null]);
  hold.keyDown("Enter", false, now());
  hold.keyUp("Enter", now());
  expect(lack()).toBe("again");
  pass(AGAIN);
  expect(lack()).toBeNull();
  hold.click(now());
  pass(GAP);
  hold.click(now());
  pass(GAP);
  expect([acted(), lack()]).toEqual([2, null]);
  hold.click(now());
  hold.clear();
  expect(lack()).toBeNull();
});

test("a tap with two fingers starts nothing", () => {
  const { hold, pass, acted } = start();
  hold.down(finger(1));
  hold.down(finger(2, false));
  hold.up(2);
  hold.up(1);
  pass(HOLD);
  // A mouse and a finger are both the first of their kind.
  hold.down(finger(1));
  hold.down(finger(7));
  hold.up(1);
  pass(HOLD);
  hold.up(7);
  hold.down(finger(3, false));
  pass(HOLD);
  hold.down({ pointerId: 1, isPrimary: true, button: 2 });
  pass(HOLD);
  expect(acted()).toBe(0);
});

test("a second pointer that is lifted does not end the hold of the first", () => {
  const { hold, pass, acted } = start();
  hold.down(finger(1));
  pass(HOLD / 2);
  hold.down(finger(2));
  hold.up(2);
  pass(HOLD / 2);
  expect(acted()).toBe(1);
});

test("a page that loses the focus, is hidden or forgets the button starts nothing", () => {
  const { hold, pass, acted, isHeld, leave, now } = start();
  hold.down(finger(1));
  hold.clear();
  expect(isHeld()).toBe(false);
  pass(HOLD);
  hold.keyDown("Enter", false, now());
  hold.keyUp("Enter", now());
  hold.clear();
  pass(GAP);
  hold.keyDown("Enter", false, now());
  hold.keyUp("Enter", now());
  hold.clear();
  hold.down(finger(1));
  leave();
  pass(HOLD);
  expect(acted()).toBe(0);
});

test("one long press of a key is no second press, however it is repeated", () => {
  const { hold, pass, acted, now } = start();
  hold.keyDown("Enter", false, now());
  for (let at = 0; at < 40; at += 1) {
    pass(30);
    hold.keyDown("Enter", true, now());
  }
  hold.keyUp("Enter", now());
  // Repeats that look like presses: up and down at once.
  pass(AGAIN);
  hold.keyDown("Enter", false, now());
  for (let at = 0; at < 40; at += 1) {
    pass(30);
    hold.keyUp("Enter", now());
    hold.keyDown("Enter", false, now());
  }
  hold.keyUp("Enter", now());
  expect(acted()).toBe(0);
});

test("two presses act, within the time and with the key up between them", () => {
  const { hold, pass, acted, now } = start();
  const press = (key: string): void => {
    hold.keyDown(key, false, now());
    pass(50);
    hold.keyUp(key, now());
  };
  press("Enter");
  pass(AGAIN);
  press("Enter");
  expect(acted()).toBe(0);
  pass(GAP);
  press("Enter");
  // Nothing follows it: it was a press of its own.
  expect(acted()).toBe(0);
  pass(GAP);
  expect(acted()).toBe(1);
  press("Enter");
  pass(GAP);
  expect(acted()).toBe(1);
  pass(AGAIN);
  // Two keys that are down together are no two presses.
  hold.keyDown("Enter", false, now());
  pass(GAP);
  hold.keyDown(" ", false, now());
  expect(acted()).toBe(1);
});

test("a key that bounces, also on a page that hears of it late, is one press", () => {
  const { hold, pass, acted, now } = start();
  const at = now();
  hold.keyDown("Enter", false, at);
  // The page was busy for a second, and hears of the rest now.
  pass(1_000);
  hold.keyUp("Enter", at + 8);
  hold.keyDown("Enter", false, at + 16);
  hold.keyUp("Enter", at + 24);
  pass(GAP);
  expect(acted()).toBe(0);
});

test("one long press that a remote desktop sends as presses, after its first pause too, starts nothing", () => {
  const { pass, press, acted } = start();
  press();
  pass(500);
  for (let at = 0; at < 40; at += 1) {
    press();
    pass(33);
  }
  pass(AGAIN);
  expect(acted()).toBe(0);
});

test("what opened its dialog is no press of the button, and neither is what a scanner types", () => {
  const { hold, pass, press, acted, now } = start();
  const early = new Holding({
    now,
    after: () => () => {},
    isAttended: () => true,
    act: () => expect.fail("it acted"),
    held: () => {},
    lacks: () => expect.fail("a press counted"),
  });
  pass(SETTLE - 1);
  early.keyDown("Enter", false, now());
  for (const _ of [1, 2]) {
    hold.otherKey();
    press();
    pass(800);
  }
  expect(acted()).toBe(0);
});
