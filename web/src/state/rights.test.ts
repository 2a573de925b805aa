import { expect, test } from "vitest";
import { grantedOf, highest, roleFor, textOf } from "./rights.ts";

test("a token for some robots is for these alone", () => {
  const robots = ["press", "saw", "press,saw", "", "*", null];
  const roles = (of: string | null) => robots.map((robot) => roleFor("operator", of, robot));
  expect(roles("press,saw")).toEqual(["operator", "operator", null, null, null, null]);
  expect(roles("saw")).toEqual([null, "operator", null, null, null, null]);
  expect(roles("")).toEqual([null, null, null, null, null, null]);
  expect(roles(null)).toEqual(["operator", "operator", "operator", "operator", "operator", "operator"]);
});

test("a robot can have a lower role of its own, and never a higher one", () => {
  const robots = "press,saw=viewer,mill=admin,*=operator";
  const roles = ["press", "saw", "mill", "oven", null].map((robot) => roleFor("engineer", robots, robot));
  expect(roles).toEqual(["engineer", "viewer", "engineer", "operator", null]);
  expect(roleFor("admin", "saw=king", "saw")).toBe("viewer");
});

test("the highest role somewhere is not always that of the grant", () => {
  expect(highest("admin", null)).toBe("admin");
  expect(highest("admin", "saw=viewer,press=operator")).toBe("operator");
  expect(highest("admin", "saw=viewer,*")).toBe("admin");
});

test("robots are written as the API has them", () => {
  for (const text of ["press", "press,saw=viewer,*=operator", "*"]) expect(textOf(grantedOf(text))).toBe(text);
  expect([grantedOf(null), grantedOf("")]).toEqual([[], []]);
});
