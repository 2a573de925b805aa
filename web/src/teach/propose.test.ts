import { expect, test } from "vitest";
import { EMPTY, type Document, read } from "./document.ts";
import { pointsIn, proposed, standsAt, usesOf } from "./propose.ts";

const POINTS = `# point "P1" = axes [1, 0] pose [1, 0, 0, 0, 0, 0]
# point "P2" = axes [2, 0]
# point "P3" = axes [3, 0] pose [3, 0, 0, 0, 0, 0]
`;
const to = (name: string): string => `[[instruction]]\ndo = "axis-move"\nto = [${name.slice(1)}, 0] # point "${name}"\nspeed = 20\n`;
const WAIT = '[[instruction]]\ndo = "wait"\nseconds = 1\n';

function start(...steps: string[]): Document {
  const result = read(POINTS + steps.join(""));
  if ("wrong" in result) throw new Error("not read");
  return result.ok;
}

const names = (document: Document, ...at: (number | null)[]): (string | undefined)[] =>
  at.map((before) => proposed(document, before, "axes")?.name);

test("points are offered in their order, as long as one is not used", () => {
  expect(names(start(), null)).toEqual(["P1"]);
  expect(names(start(to("P1")), 0)).toEqual(["P2"]);
  expect(names(start(to("P1"), to("P3")), 0, 1)).toEqual(["P2", "P2"]);
  expect(proposed(start(to("P1")), 0, "pose")?.name, "P2 has no pose").toBe("P3");
});

test("when all are used, the one after the point of the step before is offered, else the last", () => {
  const all = start(to("P1"), WAIT, to("P2"), to("P3"));
  expect(names(all, null, 0, 1, 2, 3)).toEqual(["P3", "P2", "P2", "P3", "P3"]);
  expect(proposed(EMPTY, null, "axes")).toBeNull();
});

test("a step uses the points whose numbers it has", () => {
  const document = start(to("P1"), WAIT, to("P2").replace("[2,", "[9,"));
  expect(document.steps.map((step) => pointsIn(document, step))).toEqual([["P1"], [], []]);
  expect([usesOf(document, "P1"), usesOf(document, "P2")]).toEqual([1, 0]);
});

test("at a step the arm stands at the point of its move or of the last move before, if the steps tell that", () => {
  const P1 = to("P1");
  const own = P1.replace("[1, 0]", "[1, 5]");
  const step = (text: string): string => `[[step]]\n${text}\n`;
  const rows: [what: string, steps: string[], point: string | null][] = [
    ["nothing moved yet", [WAIT], null],
    ["its own move", [to("P2"), P1], "P1"],
    ["an output and a wait behind it", [to("P2"), P1, '[[instruction]]\ndo = "output"\npoint = "Y010"\non = true\n', WAIT], "P1"],
    ["a move with numbers of its own", [P1, own, WAIT], null],
    ["a move to registers", [P1, step('do = "move-to-registers"\nspeed = 5'), WAIT], null],
    ["a label, which is jumped to", [P1, step('do = "label"\nname = "again"'), WAIT], null],
    ["another program that was called", [P1, step('do = "call"\nprogram = "other"'), WAIT], null],
  ];
  for (const [what, steps, point] of rows) {
    expect(standsAt(start(...steps), steps.length - 1)?.name ?? null, what).toBe(point);
  }
});
