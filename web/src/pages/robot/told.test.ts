import { expect, test } from "vitest";
import { en } from "../../i18n/en.ts";
import { told } from "./told.svelte.ts";

test("what became of a request is told on the page of its robot alone", () => {
  told.say("saw", "Start: accepted.", "control");
  told.answer("press", en.control.start, { kind: "unknown" }, en, "io");
  expect(told.of("saw")).toEqual({ text: "Start: accepted.", isBad: false, part: "control" });
  expect(told.of("press")?.part).toBe("io");
  expect(told.of("press")?.text).toContain("OUTCOME UNKNOWN");
  expect(told.of("pack")).toBeNull();
  told.clear("saw");
  expect([told.of("saw"), told.of("press")?.isBad]).toEqual([null, true]);
});
