import { expect, test } from "vitest";
import { viewLike } from "../../../tests/view.ts";
import type { Run } from "../../api/types.ts";
import { en } from "../../i18n/en.ts";
import type { Sent } from "../../run/sent.ts";
import { ceased, isOfOther, outcomeOf } from "./outcome.ts";

const REFUSED: Sent = {
  kind: "list_refused",
  failure: { code: "refused", message: "the controller refused the instruction list" },
};

test("a list that the controller refused was sent, and is not told as nothing sent", () => {
  const told = outcomeOf(REFUSED, "saw", en, String);
  expect(told).toMatchObject({ state: "bad", text: expect.stringContaining("the controller refused the instruction list") });
  expect(told?.text).not.toContain("nothing was sent");
});

test("a program is told as not running any more only if it ran before, and is seen not to run on the same machine", () => {
  const before = viewLike("saw", { mode: 7, program: "pick" });
  const now = viewLike("saw", { mode: 3 });
  const ended = (state: Run["state"]): Sent => ({ kind: "ended", run: { state } as Run });
  for (const sent of [REFUSED, ended("failed"), ended("stopped"), ended("unknown")]) {
    expect(ceased(sent, before, now), JSON.stringify(sent)).toEqual({ name: "pick" });
  }
  expect(ceased(REFUSED, viewLike("saw", { mode: 7 }), now), "the firmware does not tell its name").toEqual({ name: null });
  for (const [what, sent, then, seen] of [
    ["nothing was sent", ended("refused"), before, now],
    ["nothing was sent", { kind: "refused", failure: { code: "not_ready", message: "" } }, before, now],
    ["it is under way", { kind: "sent" }, before, now],
    ["another page sent it", REFUSED, null, now],
    ["it did not run before", REFUSED, viewLike("saw", { mode: 2 }), now],
    ["it still runs", REFUSED, before, before],
    ["its mode is old", REFUSED, before, viewLike("saw", { mode: 3, quality: "stale" })],
    ["another machine answers", REFUSED, before, viewLike("saw", { mode: 3, who: 2 })],
  ] as const) {
    expect(ceased(sent, then, seen), what).toBeNull();
  }
});

test("of another program only an end that needs nothing is left out", () => {
  const ended = (state: Run["state"]): Sent => ({ kind: "ended", run: { state } as Run });
  expect(isOfOther(ended("done"), "a", "b")).toBe(true);
  for (const [what, sent, ran, name] of [
    ["the same program", ended("done"), "b", "b"],
    ["another page sent it", ended("done"), null, "b"],
    ["the page of the robot", ended("done"), "a", undefined],
    ["it failed", ended("failed"), "a", "b"],
    ["its end is not known", ended("unknown"), "a", "b"],
    ["it is under way", { kind: "sent" }, "a", "b"],
    ["nothing was sent", null, "a", "b"],
  ] as const) {
    expect(isOfOther(sent, ran, name), what).toBe(false);
  }
});
