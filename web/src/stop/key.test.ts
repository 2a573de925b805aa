import { expect, test } from "vitest";
import { isKey, isStopKey } from "./key.ts";

test("F9 stops once for a press, also while an input method composes a word", () => {
  const press = { key: "F9", code: "F9", repeat: false };
  expect(isStopKey(press)).toBe(true);
  // As chromium tells it while a word of Chinese is composed, and a keyboard without codes.
  expect(isStopKey({ ...press, key: "Process" })).toBe(true);
  expect(isStopKey({ ...press, code: "" })).toBe(true);
  expect([isStopKey({ ...press, repeat: true }), isKey({ ...press })]).toEqual([false, true]);
  expect(isStopKey({ key: "F8", code: "F8", repeat: false })).toBe(false);
});
