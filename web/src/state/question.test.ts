import { beforeEach, expect, test, vi } from "vitest";
import type { Answer } from "../api/client.ts";

const FAILED: Answer<string> = { kind: "refused", status: 503, problem: { code: "overloaded", message: "busy" } };

/** A question whose answers the test gives, in any order. */
async function question() {
  vi.stubGlobal("location", { hash: "", pathname: "/", search: "" });
  vi.stubGlobal("matchMedia", () => ({ matches: false, addEventListener: () => {} }));
  vi.resetModules();
  const { Question } = await import("./question.svelte.ts");
  const answers: ((answer: Answer<string>) => void)[] = [];
  const one = new Question<string>(() => new Promise((answer) => answers.push(answer)));
  return { one, answer: (at: number, value: Answer<string>) => answers[at]?.(value) };
}

beforeEach(() => vi.unstubAllGlobals());

test("a failed question keeps the answer before it, and says that it is old", async () => {
  const { one, answer } = await question();
  const first = one.ask();
  expect([one.value, one.isAsking, one.isOld]).toEqual([null, true, false]);
  answer(0, { kind: "ok", value: "a" });
  await first;
  expect([one.value, one.isAsking, one.isOld]).toEqual(["a", false, false]);
  const second = one.ask();
  answer(1, FAILED);
  await second;
  expect([one.value, one.failure?.code, one.isOld]).toEqual(["a", "overloaded", true]);
  const third = one.ask();
  answer(2, { kind: "unknown" });
  await third;
  expect([one.value, one.failure?.code]).toEqual(["a", "no_answer"]);
});

test("of several questions only the last one counts, and none after it was forgotten", async () => {
  const { one, answer } = await question();
  const asked = [one.ask(), one.ask()];
  answer(1, { kind: "ok", value: "new" });
  answer(0, { kind: "ok", value: "old" });
  await Promise.all(asked);
  expect([one.value, one.isAsking]).toEqual(["new", false]);
  const late = one.ask();
  one.forget();
  answer(2, { kind: "ok", value: "late" });
  await late;
  expect([one.value, one.isAsking]).toEqual([null, false]);
});
