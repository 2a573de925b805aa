import { expect, test } from "vitest";
import { type Command, type Grip, apply, copied, freeName, putPoint, putPointAndSteps, removePoint, stepsTo, withField, withoutField } from "./commands.ts";
import { type Document, EMPTY, type Point, doOf, fieldOf, fieldWith, linked, newStep, pointsOf, read, valueAt, write } from "./document.ts";
import { MAX_ENTRIES, change, choose, historyOf, redo, undo } from "./history.ts";

const TEXT = `# point "P1" = axes [1, 2, 3] pose [4, 5, 6, 7, 8, 9]
# above the chute
[[instruction]]
do = "axis-move"
to = [1, 2, 3] # fast # point "P1"
speed = 50
[[instruction]]
do = "linear-move"
to = [4, 5, 6] # point "P1"
speed = 10
[[instruction]]
do = "wait"
seconds = 1
`;

function start(text = TEXT): Document {
  const result = read(text);
  if ("wrong" in result) throw new Error("not read");
  return result.ok;
}

const wait = newStep("instruction", [
  { key: "do", value: "wait" },
  { key: "seconds", value: 0.5 },
]);

/** A new point, and what the arm does there. */
function taken(document: Document, point: Point, at: number, grip: Grip | null = null): Command {
  return putPointAndSteps(document, point, at, stepsTo(document, point, at, grip));
}

function commands(document: Document): Command[] {
  return [
    { kind: "insert", at: 0, steps: [wait] },
    { kind: "insert", at: 3, steps: copied([wait, wait]) },
    { kind: "remove", at: 0, count: 2 },
    { kind: "move", from: 0, to: 2 },
    { kind: "move", from: 2, to: 1 },
    { kind: "change", at: 2, step: withField(document.steps[2]!, fieldWith("seconds", 2)) },
    { kind: "change", at: 0, step: withoutField(document.steps[0]!, "speed") },
    putPoint(document, null, { name: "P2", axes: [0, 0, 0], pose: null }),
    putPoint(document, "P1", { name: "above", axes: [9, 9, 9], pose: [1, 1, 1, 1, 1, 1] }),
    removePoint(document, "P1"),
    taken(document, { name: "P2", axes: [0, 0, 0], pose: null }, 1),
    taken(document, { name: "P2", axes: [0, 0, 0], pose: null }, 1, { output: "Y011", on: false }),
    { kind: "replace", document: EMPTY },
    { kind: "all", commands: [{ kind: "remove", at: 1, count: 1 }, { kind: "insert", at: 0, steps: [wait] }] },
  ];
}

test("each change is taken back by its inverse, to the byte, and changes nothing in place", () => {
  const document = start();
  for (const command of commands(document)) {
    const { document: after, inverse } = apply(document, command);
    expect(write(after), JSON.stringify(command)).not.toBe(TEXT);
    expect(write(document)).toBe(TEXT);
    const back = apply(after, inverse);
    expect(write(back.document), JSON.stringify(command)).toBe(TEXT);
    expect(back.document.steps.map(({ id }) => id)).toEqual(document.steps.map(({ id }) => id));
    expect(write(apply(back.document, back.inverse).document)).toBe(write(after));
  }
});

test("steps that are not there are a mistake", () => {
  const document = start();
  for (const command of [
    { kind: "remove", at: 2, count: 2 },
    { kind: "insert", at: 4, steps: [] },
    { kind: "move", from: 0, to: 3 },
    { kind: "change", at: 3, step: wait },
  ] satisfies Command[]) {
    expect(() => apply(document, command)).toThrow();
  }
});

test("a comment above a step goes with it", () => {
  const { document } = apply(start(), { kind: "move", from: 1, to: 0 });
  expect(write(document)).toMatch(/^# point[^]*linear-move[^]*# fast # point "P1"/);
});

test("moves to a point go with it, and keep its numbers when it goes", () => {
  const moved = apply(start(), putPoint(start(), "P1", { name: "above", axes: [9, 8, 7], pose: null })).document;
  expect(pointsOf(moved)).toEqual([{ name: "above", axes: [9, 8, 7], pose: null }]);
  expect(linked(moved, moved.steps[0]!, "to")?.name).toBe("above");
  expect(fieldOf(moved.steps[0]!, "to")?.text).toBe('to = [9, 8, 7] # fast # point "above"\n');
  // The point has no pose any more: the line keeps the numbers as its own.
  expect(fieldOf(moved.steps[1]!, "to")?.text).toBe("to = [4, 5, 6]\n");
  const removed = apply(start(), removePoint(start(), "P1")).document;
  expect([pointsOf(removed), valueAt(removed.steps[0]!, "to"), write(removed).includes("point")]).toEqual([[], [1, 2, 3], false]);
});

test("a move with other numbers than its point stays as it is", () => {
  const document = start(TEXT.replace("to = [1, 2, 3]", "to = [1, 2, 4]"));
  const { document: after } = apply(document, putPoint(document, "P1", { name: "P1", axes: [0, 0, 0], pose: null }));
  expect(valueAt(after.steps[0]!, "to")).toEqual([1, 2, 4]);
});

test("a new point goes behind the others, with a name that is free", () => {
  const document = start();
  expect(freeName(document)).toBe("P2");
  const { document: after } = apply(document, putPoint(document, null, { name: "P2", axes: [0.5, -1, 0], pose: null }));
  expect(write(after).split("\n")[1]).toBe('# point "P2" = axes [0.5, -1, 0]');
  expect(write(apply(EMPTY, putPoint(EMPTY, null, { name: '下 "1"', axes: [1], pose: null })).document)).toBe(
    '# point "下 \\"1\\"" = axes [1]\n',
  );
});

test("a point and the move to it are one change", () => {
  let now = choose(historyOf(start()), { step: 0 });
  now = change(now, taken(now.document, { name: "P2", axes: [7, 8, 9], pose: null }, 1), { step: 1 });
  expect([now.done.length, now.document.steps.length, linked(now.document, now.document.steps[1]!, "to")?.name]).toEqual([1, 4, "P2"]);
  expect(write(now.document)).toContain('do = "axis-move"\nto = [7, 8, 9] # point "P2"\nspeed = 20\n');
  now = undo(now);
  expect([write(now.document), now.selection]).toEqual([TEXT, { step: 0 }]);
  const posed = apply(EMPTY, taken(EMPTY, { name: "P1", axes: null, pose: [1, 2, 3, 4, 5, 6] }, 0)).document;
  expect(write(posed)).toContain('do = "linear-move"\nto = [1, 2, 3, 4, 5, 6] # point "P1"');
});

test("a changed field keeps its comments, also those within a list", () => {
  const document = start("[[instruction]]\n# where to\nto = [1, # J1\n 2] # there\n");
  const field = fieldWith("to", [3], fieldOf(document.steps[0]!, "to"));
  expect(field.text).toBe("# where to\n# J1\nto = [3] # there\n");
});

test("a step behind a text without an end of its last line begins on a line of its own", () => {
  const document = start('[[instruction]]\ndo = "wait"\nseconds = 1');
  const { document: after } = apply(document, { kind: "insert", at: 1, steps: [wait] });
  expect(write(after)).toBe('[[instruction]]\ndo = "wait"\nseconds = 1\n\n[[instruction]]\ndo = "wait"\nseconds = 0.5\n');
});

test("undo restores the selection, one gesture at a time", () => {
  let now = choose(historyOf(start()), { step: 2 });
  now = change(now, { kind: "remove", at: 2, count: 1 }, { step: 1 });
  now = change(now, { kind: "insert", at: 0, steps: copied([wait, wait]) }, { step: 1 });
  now = choose(now, { point: "P1" });
  now = undo(now);
  expect([now.document.steps.length, now.selection]).toEqual([2, { step: 1 }]);
  now = undo(now);
  expect([write(now.document), now.selection]).toEqual([TEXT, { step: 2 }]);
  expect(undo(now)).toBe(now);
  now = redo(redo(now));
  expect([now.document.steps.length, now.selection]).toEqual([4, { step: 1 }]);
  expect(redo(now)).toBe(now);
  now = change(undo(now), { kind: "remove", at: 0, count: 1 }, { step: 0 });
  expect(now.undone, "what was undone is gone").toEqual([]);
});

test("the history is bounded", () => {
  let now = historyOf(start());
  for (let round = 0; round < MAX_ENTRIES + 5; round += 1) now = change(now, { kind: "move", from: 0, to: 2 }, null);
  expect(now.done.length).toBe(MAX_ENTRIES);
});

test("a pick is a point, a move to it, its output, a wait and the way back, where it was asked for", () => {
  const point = { name: "P2", axes: [7, 8, 9], pose: null };
  const { document } = apply(start(), taken(start(), point, 1, { output: "Y011", on: true }));
  expect(pointsOf(document).map(({ name }) => name)).toEqual(["P1", "P2"]);
  expect(document.steps.map((step) => step.fields.map(({ key, value }) => `${key} ${String(value)}`).join(", "))).toEqual([
    "do axis-move, to 1,2,3, speed 50",
    "do axis-move, to 7,8,9, speed 20",
    "do output, point Y011, on true",
    "do wait, seconds 0.5",
    "do axis-move, to 1,2,3, speed 20",
    "do linear-move, to 4,5,6, speed 10",
    "do wait, seconds 1",
  ]);
  expect(linked(document, document.steps[1]!, "to")?.name).toBe("P2");
  expect(linked(document, document.steps[4]!, "to")?.name).toBe("P1");
  // The first step has nowhere to go back to.
  const first = apply(EMPTY, taken(EMPTY, point, 0, { output: "Y011", on: true })).document;
  expect(first.steps.map(doOf)).toEqual(["axis-move", "output", "wait"]);
});

test("a place in a taught program is steps of a taught program", () => {
  const taught = start('[[step]]\ndo = "photo"\n');
  const { document } = apply(taught, taken(taught, { name: "P1", axes: [1], pose: null }, 1, { output: "Y010", on: false }));
  expect(document.steps.map(({ table }) => table)).toEqual(["step", "step", "step", "step"]);
  expect(valueAt(document.steps[2]!, "on")).toBe(false);
});
