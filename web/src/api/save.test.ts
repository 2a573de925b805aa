import { expect, test } from "vitest";
import { joined } from "./save.ts";

test("tables of one kind become one, with one line of names", () => {
  expect(joined(["a,b\r\n1,2\r\n", "a,b\r\n3,4\r\n", "a,b\r\n"])).toBe("a,b\r\n1,2\r\n3,4\r\n");
  expect(joined([])).toBe("");
});
