import { expect, test } from "vitest";
import type { ProgramChecked } from "../../api/types.ts";
import { read } from "../../teach/document.ts";
import { bare, foundIn, withOwn } from "./found.ts";

const TEXT = 'repeet = true\n[[instruction]]\ndo = "axis-move"\nto = [1,\n  2]\nspeed = 500\n[[instruction]]\ndo = "wait"\n';

test("mistakes stand at their steps and fields, the others are of the whole program", () => {
  const result = read(TEXT);
  if ("wrong" in result) throw new Error("not read");
  const at = (line: number | null, column: number | null, message: string) => ({ line, column, message, advice: null });
  const problems = [
    at(1, 1, "there is no key `repeet`"),
    at(5, 3, "instruction 1: `to` is wrong"),
    at(6, 9, "instruction 1: `speed` is 500"),
    at(7, 1, "instruction 2: `seconds` is missing"),
    at(null, null, "there is too much"),
  ];
  const { steps, whole } = foundIn(result.ok, { problems } as unknown as ProgramChecked);
  expect([...steps].map(([step, all]) => [step, ...all.map(({ key, line, message }) => `${line} ${key}: ${message}`)])).toEqual([
    [0, "5 to: `to` is wrong", "6 speed: `speed` is 500"],
    [1, "7 null: `seconds` is missing"],
  ]);
  expect(whole.map(({ line }) => line)).toEqual([1, null]);
  const both = withOwn({ steps, whole }, new Map([[0, "it has no J5"]]));
  expect(both.steps.get(0)?.map(({ line, message }) => [line, message])).toEqual([
    [5, "`to` is wrong"],
    [6, "`speed` is 500"],
    [null, "it has no J5"],
  ]);
  expect(steps.get(0)?.length).toBe(2);
  expect(foundIn(result.ok, null)).toEqual({ steps: new Map(), whole: [] });
});

test("a message beside its step does not name it again", () => {
  expect([
    bare("instruction 3: `seconds` is 0.33"),
    bare("step 12 (axis-move): `to` is missing"),
    bare("instruction 1 (axis move) ends with alarm 130"),
    bare("program `program`, step 2 (photo of camera 0) ends with alarm 9"),
    bare("program `other`, step 2 (wait) ends"),
    bare("J1 above its limit"),
  ]).toEqual(["`seconds` is 0.33", "`to` is missing", "ends with alarm 130", "ends with alarm 9", "program `other`, step 2 (wait) ends", "J1 above its limit"]);
});
