import { expect, test } from "vitest";
import { en } from "../i18n/en.ts";
import { keptAs } from "./kept.ts";

test("a program with points and no step has no mistake: it has no step yet", () => {
  expect([
    keptAs({ ok: true, kind: "instructions" }),
    keptAs({ ok: true, kind: "taught" }),
    keptAs({ ok: false, kind: "neither" }),
    keptAs({ ok: false, kind: "instructions" }),
    keptAs({ ok: false, kind: "taught" }),
  ]).toEqual(["ok", "taught", "no_step", "mistakes", "mistakes"]);
  expect(en.teach.programs.kept.no_step).not.toContain("mistake");
});
