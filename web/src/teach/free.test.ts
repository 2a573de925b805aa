import { expect, test } from "vitest";
import { free } from "./free.ts";

test("a new name is the first one that nothing has, also in a gap", () => {
  expect(free("P", [])).toBe("P1");
  expect(free("P", ["P1", "P3", "above"])).toBe("P2");
  expect(free("program-", ["program-2", "program-1", "program-10"])).toBe("program-3");
});
