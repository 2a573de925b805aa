import { readFileSync } from "node:fs";
import { expect, test } from "vitest";
import type { Failure } from "../src/api/failure.ts";
import { en } from "../src/i18n/en.ts";
import { zh } from "../src/i18n/zh.ts";
import { REFUSALS, refusalOf } from "../src/i18n/zh/refusals.ts";

const API = readFileSync(new URL("../../openapi/gateway.json", import.meta.url), "utf8");
const CODES: string[] = JSON.parse(API).components.schemas.Code.enum;
const failure = (code: string, message = "the arm is asleep"): Failure => ({ code: code as Failure["code"], message });

test("each code of the gateway says in Chinese what is wrong and what to do", () => {
  expect(CODES.length).toBeGreaterThan(80);
  for (const code of CODES) {
    const [what, next] = REFUSALS[code as Failure["code"]] ?? [];
    expect(what, code).toMatch(/^\p{Script=Han}.*。$/u);
    expect(next, code).toMatch(/^\p{Script=Han}.*。$/u);
    expect(zh.ui.refusal(failure(code)), code).toBe(`${what}${next}`);
  }
  expect(Object.keys(REFUSALS).filter((code) => code !== "no_answer" && !CODES.includes(code))).toEqual([]);
});

test("no sentence of a Chinese page repeats what the gateway says in English", () => {
  const said = "the arm is asleep";
  const all = [
    zh.ui.refusal(failure("not_ready")),
    zh.ui.refusal(failure("of_a_newer_gateway")),
    zh.signIn.problem("overloaded", said),
    zh.control.alarmRefused("清除报警", said, false),
    zh.control.alarmRefused("清除报警", said, true),
    zh.control.startRefused("启动", said),
    zh.stop.why("overloaded"),
    zh.stop.why("of_a_newer_gateway"),
  ];
  for (const text of all) expect(text).not.toMatch(/asleep|newer|overloaded|undefined/);
  expect(refusalOf("of_a_newer_gateway")[1]).toContain("原文");
});

test("an English page says what the gateway says, with the code", () => {
  expect(en.ui.refusal(failure("leased"))).toBe("the arm is asleep (leased)");
  expect(en.ui.refusal(failure("leased"), false)).toBe("the arm is asleep");
  expect(en.ui.refusal(failure("no_answer", ""))).toBe("The gateway does not answer.");
});
