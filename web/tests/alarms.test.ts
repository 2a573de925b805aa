import { readFileSync } from "node:fs";
import { expect, test } from "vitest";
import { en } from "../src/i18n/en.ts";
import { zh } from "../src/i18n/zh.ts";
import { SPANS } from "../src/i18n/zh/codes.ts";

const TABLE = new URL("../../crates/r6-proto/src/alarm.rs", import.meta.url);

/** The rows of the table of the product: their first and last codes. */
function rows(): number[][] {
  const named: Record<string, number> = { "AlarmCode::POSITIVE_LIMITS": 130, "AlarmCode::NEGATIVE_LIMITS": 140, "AlarmCode::LAST.0": 10_000 };
  const number = (text: string): number => named[text] ?? Number(text);
  return [...readFileSync(TABLE, "utf8").matchAll(/^ {4}(?:row|live)\(([^,]+), Span::(One|Axes|To\(([^)]+)\)), "/gm)].map(
    ([, first = "", span = "", last = ""]) => {
      const from = number(first);
      return [from, span === "One" ? from : span === "Axes" ? from + 7 : number(last)];
    },
  );
}

test("each alarm of the table of the product has its text in Chinese", () => {
  expect(rows().length).toBeGreaterThan(70);
  expect(SPANS).toEqual(rows());
});

test("an alarm is told in the language of the page; an unknown one as the gateway tells it", () => {
  expect(en.alarms.textOf(135, "J6: positive soft limit")).toBe("J6: positive soft limit");
  expect(zh.alarms.textOf(135, "J6: positive soft limit")).toBe("J6：正向软限位");
  expect(zh.alarms.textOf(5001, "user alarm of the program")).toBe("程序的用户报警");
  expect(zh.alarms.textOf(2053, "waiting for X015 took too long")).toBe("等待 X015 超时");
  expect(zh.alarms.textOf(31, "not in the table of alarms")).toBe("not in the table of alarms");
  expect(zh.alarms.remedyOf(7, "make the cell safe")).toContain("松开急停");
  expect(zh.needs.cause({ kind: "alarm", code: 7, text: "emergency stop", acknowledged: null }, 1)).toBe("报警 7：急停");
  expect(zh.doing({ kind: "alarm", code: 7, text: "emergency stop" })).toContain("急停");
});
