import { expect, test } from "vitest";
import { firstFreeName } from "./free.ts";

test("a new name has the lowest number that is not taken", () => {
  expect(firstFreeName("P", [])).toBe("P1");
  expect(firstFreeName("P", ["P1", "P3", "above"])).toBe("P2");
  expect(firstFreeName("program-", ["program-2", "program-1", "program-10"])).toBe("program-3");
});
