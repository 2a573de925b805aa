import { expect, test } from "vitest";
import { inBar } from "./reach.ts";

test("while a twin may move by a page, the bar has its stop too, and F9 reaches it", () => {
  const never = (): boolean => false;
  const saw = { robot: "saw", hasKey: true };
  expect(inBar("saw", null, "saw", () => true)).toEqual([saw]);
  expect(inBar("saw", "saw-twin", "saw", never)).toEqual([saw]);
  // It is chosen, and nothing moves it: its stop is at hand, and F9 leaves it alone.
  expect(inBar("saw", "saw-twin", "saw-twin", never)).toEqual([{ robot: "saw-twin", hasKey: false }, saw]);
  // Its run goes on, also after the arm was chosen.
  for (const target of ["saw", "saw-twin", null]) {
    expect(inBar("saw", "saw-twin", target, (robot) => robot === "saw-twin"), String(target)).toEqual([
      { robot: "saw-twin", hasKey: true },
      saw,
    ]);
  }
});
