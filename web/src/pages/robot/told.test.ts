import { expect, test, vi } from "vitest";
import { viewLike } from "../../../tests/view.ts";
import { en } from "../../i18n/en.ts";
import { zh } from "../../i18n/zh.ts";

test("what became of a request is told on the page of its robot alone, where the person acted", async () => {
  vi.stubGlobal("matchMedia", () => ({ matches: false, addEventListener: () => {} }));
  const { told } = await import("./told.svelte.ts");
  told.say("saw", "Start: accepted.", "control");
  told.answer("press", en.control.start, { kind: "unknown" }, en, "io");
  expect(told.at("saw", "control")).toMatchObject({ text: "Start: accepted.", state: "done" });
  expect(told.at("saw", "io")).toBeNull();
  expect(told.at("press", "io")?.text).toContain("OUTCOME UNKNOWN");
  expect(told.at("pack", "io")).toBeNull();
  told.clear("saw");
  expect([told.at("saw", "control"), told.at("press", "io")?.state]).toEqual([null, "bad"]);
});

test("a refusal because the robot does not answer says so, and that it can be tried again", async () => {
  vi.stubGlobal("matchMedia", () => ({ matches: false, addEventListener: () => {} }));
  const { told } = await import("./told.svelte.ts");
  const { hall } = await import("../../state/hall.svelte.ts");
  const refused = { kind: "refused", status: 409, problem: { code: "not_ready", message: "it does not answer" } } as const;
  const say = (words: typeof en, view: ReturnType<typeof viewLike> | null): string => {
    hall.views = view === null ? [] : [view];
    told.answer("saw", words.control.start, refused, words, "control");
    return told.at("saw", "control")?.text ?? "";
  };
  const again = "Try again in a moment. Gateway: it does not answer";
  const waits = "The gateway waits for an answer of the robot.";
  expect(say(en, viewLike("saw", { quality: "stale" }))).toBe(`Start: nothing was sent. ${waits} ${again}`);
  expect(say(en, viewLike("saw", {}, { link: "down" }))).toContain(waits);
  // The page sees nothing of it yet: it says no more than it knows.
  expect(say(en, viewLike("saw"))).toContain("The gateway may wait for an answer of the robot. Try again in a moment.");
  expect(say(en, null)).toContain("may wait");
  expect(say(zh, viewLike("saw", { quality: "stale" }))).toBe("启动：什么都没有发送。网关正在等待机器人的应答。请稍候再试。");
  // The pendant leads: waiting does not help.
  expect(say(en, viewLike("saw", { mode: 1 }))).toBe("Start: refused. it does not answer");
  hall.views = null;
});
