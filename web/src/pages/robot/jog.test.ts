import { expect, test } from "vitest";
import { EVERY, Jog } from "./jog.ts";

/** A world whose requests the test answers, and whose clock stands still. */
function world() {
  const asked: string[] = [];
  const answers: ((is: boolean) => void)[] = [];
  const waits: (() => void)[] = [];
  const moves: string[] = [];
  const request = (what: string): Promise<boolean> => {
    asked.push(what);
    return new Promise((answer) => answers.push(answer));
  };
  const jog = new Jog({
    now: () => 0,
    wait: (ms) => {
      expect(ms).toBe(EVERY);
      return new Promise((go) => waits.push(() => go()));
    },
    begin: (axis, up) => request(`begin ${axis}${up ? "+" : "-"}`),
    keep: () => request("keep"),
    end: () => void asked.push("end"),
    moves: (what) => void moves.push(what === null ? "none" : what.axis),
  });
  const settle = async (): Promise<void> => {
    for (let turn = 0; turn < 5; turn += 1) await Promise.resolve();
  };
  return {
    jog,
    asked,
    moves,
    answer: async (is: boolean) => (answers.shift()?.(is), settle()),
    pass: async () => (waits.shift()?.(), settle()),
  };
}

test("a button that is held asks again and again, and once more when it is let go", async () => {
  const { jog, asked, moves, answer, pass } = world();
  void jog.hold("J1", true);
  await answer(true);
  await pass();
  await answer(true);
  await pass();
  expect(asked).toEqual(["begin J1+", "keep", "keep"]);
  jog.release();
  jog.release();
  expect(asked).toEqual(["begin J1+", "keep", "keep", "end"]);
  await answer(true);
  await pass();
  expect(asked).toHaveLength(4);
  expect(moves).toEqual(["J1", "none"]);
});

test("the end comes behind the begin, and nothing begins before that", async () => {
  const { jog, asked, answer } = world();
  void jog.hold("J1", true);
  jog.release();
  void jog.hold("J2", false);
  expect(asked).toEqual(["begin J1+"]);
  await answer(true);
  expect(asked).toEqual(["begin J1+", "end"]);
  void jog.hold("J2", false);
  expect(asked.at(-1)).toBe("begin J2-");
});

test("a move that the controller has ended is not begun again by a button that is still held", async () => {
  for (const begins of [true, false]) {
    const { jog, asked, moves, answer, pass } = world();
    void jog.hold("J1", true);
    await answer(begins);
    if (begins) {
      await pass();
      await answer(false);
    }
    const told = asked.length;
    await pass();
    expect(asked).toHaveLength(told);
    expect(moves.at(-1)).toBe("none");
    expect(jog.isOn).toBe(false);
    jog.release();
    expect(asked).not.toContain("end");
  }
});

test("a second button does nothing while one is held", async () => {
  const { jog, asked, answer, pass } = world();
  void jog.hold("J1", true);
  await answer(true);
  void jog.hold("J2", true);
  await pass();
  expect(asked).toEqual(["begin J1+", "keep"]);
});
