import { expect, test } from "vitest";
import { assumed } from "./assume.ts";
import { read, write } from "./document.ts";

test("a wait for a signal becomes one of no time, and everything else stays", () => {
  const text = `[[instruction]]
do = "wait"
seconds = 2
[[instruction]]
do = "wait" # for the part
point = "X010"
limit = 5
[[instruction]]
do = "output"
point = "Y010"
on = true
`;
  const result = read(text);
  if ("wrong" in result) throw new Error("not read");
  const { document, waits } = assumed(result.ok);
  expect(waits).toEqual([1]);
  expect(write(document)).toBe(text.replace('point = "X010"\nlimit = 5\n', "seconds = 0\n"));
  expect(write(result.ok)).toBe(text);
  const without = read(text.replace('point = "X010"', "seconds = 1"));
  if ("wrong" in without) throw new Error("not read");
  expect(assumed(without.ok).document).toBe(without.ok);
});
