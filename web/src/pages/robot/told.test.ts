import { expect, test, vi } from "vitest";
import { en } from "../../i18n/en.ts";

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
