import { readFileSync, readdirSync } from "node:fs";
import { expect, test } from "vitest";
import { type Document, doOf, isTaught, linked, listOf, locate, pointsOf, read, valueAt, write } from "./document.ts";
import { writeValue, valueOf } from "./toml.ts";

const EXAMPLES = new URL("../../../examples/", import.meta.url);

function ok(text: string): Document {
  const result = read(text);
  if ("wrong" in result) throw new Error(JSON.stringify(result.wrong));
  return result.ok;
}

function wrong(text: string): string {
  const result = read(text);
  return "ok" in result ? "read" : `${result.wrong.line}:${result.wrong.column} ${result.wrong.what}`;
}

test("each example is written as it was read, byte by byte", () => {
  let seen = 0;
  for (const folder of ["programs/", "taught/"]) {
    for (const name of readdirSync(new URL(folder, EXAMPLES)).filter((one) => one.endsWith(".toml"))) {
      const text = readFileSync(new URL(folder + name, EXAMPLES), "utf8");
      expect(write(ok(text)), name).toBe(text);
      seen += 1;
    }
  }
  expect(seen).toBeGreaterThanOrEqual(3);
});

const PROGRAM = `# a program
repeat = false # once
# point "above" = axes [0, 10, -20, 0, -80, 0] pose [360, -50, 500, 180, 0, 180]

# goes there
[[instruction]] # first
do = "axis-move"
  to = [0, 10, -20, 0, -80, 0] # point "above"
speed = 5_0
# rounds it
blend = 0x3
[[instruction]]
do = 'linear-move'
to = [ 360, -50, # in two lines
  500 ] # point "above"
speed = 1e1
# the end
`;

test("comments, spaces and spellings stay", () => {
  for (const text of [PROGRAM, PROGRAM.replaceAll("\n", "\r\n"), PROGRAM.trimEnd(), "", "\n\n", "# x", `\uFEFF${PROGRAM}`]) {
    expect(write(ok(text))).toBe(text);
  }
  const document = ok(PROGRAM);
  expect(document.steps.map(doOf)).toEqual(["axis-move", "linear-move"]);
  expect(["speed", "blend"].map((key) => valueAt(document.steps[0]!, key))).toEqual([50, 3]);
  expect(pointsOf(document).map(({ name }) => name)).toEqual(["above"]);
  expect([listOf(document), listOf(ok("repeat = true\nappend=true"))]).toEqual([
    { repeats: false, appends: false },
    { repeats: true, appends: true },
  ]);
});

test("a move has the numbers of a point only if they are the same", () => {
  const document = ok(PROGRAM);
  const of = (at: number, text = PROGRAM): string | null => linked(ok(text), ok(text).steps[at]!, "to")?.name ?? null;
  expect([of(0), of(1)]).toEqual(["above", "above"]);
  expect(of(0, PROGRAM.replace("0, -80, 0] #", "0, -81, 0] #")), "changed by hand").toBeNull();
  expect(of(1, PROGRAM.replace("500 ]", "501 ]"))).toBeNull();
  expect(of(0, PROGRAM.replace('"above" =', '"other" ='))).toBeNull();
  expect(of(0, PROGRAM.replace(" axes [0, 10, -20, 0, -80, 0]", "")), "the point has no axes").toBeNull();
  expect(linked(document, document.steps[0]!, "speed")).toBeNull();
});

test("a line of the text leads to its step and field", () => {
  const at = (line: number, document = ok(PROGRAM)) => locate(document, line);
  expect([1, 2, 3, 4, 5].map((line) => at(line))).toEqual([null, null, null, null, null]);
  expect(at(6)).toEqual({ step: 0, key: null });
  expect(at(8)).toEqual({ step: 0, key: "to" });
  expect(at(11)).toEqual({ step: 0, key: "blend" });
  expect([13, 14, 15, 16].map((line) => at(line)?.key)).toEqual(["do", "to", "to", "speed"]);
  expect(at(99)).toBeNull();
  const short = "[[step]]\ndo = \"end\"";
  expect([locate(ok(short), 1), locate(ok(short), 2), locate(ok(short), 3)]).toEqual([
    { step: 0, key: null },
    { step: 0, key: "do" },
    null,
  ]);
});

test("tables of taught programs that are no steps are kept", () => {
  const text = `[[stack]]\nspacing = [1, 2, 3]\ncount = [1, 1, 1]\n[[step]]\ndo = "label"\nname = "again # not a comment"\n[[counter]]\nnumber = 3\n[[step]]\ndo = "jump"\nto = "again # not a comment"\n`;
  const document = ok(text);
  expect(write(document)).toBe(text);
  expect([document.steps.length, isTaught(document), valueAt(document.steps[1]!, "to")]).toEqual([
    2,
    true,
    "again # not a comment",
  ]);
});

test("what is not understood is refused with line and column", () => {
  expect([
    wrong(" { \"reqType\": \"AddRCC\" }"),
    wrong("// a frame\n{}"),
    wrong("[[instruction]]\nto = { x = 1 }"),
    wrong("[[instruction]]\ndo = \"\"\"x\"\"\""),
    wrong("[[instruction]]\n  do = \"x\n"),
    wrong("[[instruction]]\nto = [1,\n2"),
    wrong("[[instruction]]\nto = [1 2]"),
    wrong("[[instruction]]\nto.x = 1"),
    wrong("[[instruction]]\nto = 2026-11-26"),
    wrong("[[instruction]]\nto = 01"),
    wrong("[[instruction]]\nto = nan"),
    wrong("[[instruction]]\nto = 1 2"),
    wrong("[[instruction]]\nto = 1\nto = 2"),
    wrong("[[instruction.more]]"),
    wrong("中 = 1"),
    wrong("[instruction]"),
    wrong("a = [[[[[1]]]]]"),
    wrong(`a = "${"x".repeat(300_000)}"`),
  ]).toEqual([
    "1:2 frames",
    "1:1 frames",
    "2:6 table_value",
    "2:6 long_text",
    "2:8 open_text",
    "2:6 open_list",
    "2:9 value",
    "2:1 key",
    "2:6 date",
    "2:6 value",
    "2:6 value",
    "2:7 behind",
    "3:1 twice",
    "1:1 header",
    "1:1 key",
    "1:1 header",
    "1:9 too_deep",
    "1:1 too_long",
  ]);
});

test("values are read as they were written", () => {
  for (const value of [0, -12.5, 1e-7, 1e21, true, "", 'a "b" \\ \u0007 中', [1, -2.25], ["Y010", "Y011"], [[1], []]]) {
    expect(valueOf(writeValue(value)), writeValue(value)).toEqual(value);
  }
  expect([valueOf("1_000"), valueOf("0b101"), valueOf("'a\\n'"), valueOf('"\\u4e2d\\n"')]).toEqual([1000, 5, "a\\n", "中\n"]);
  for (const none of ["", "1 1", "[1", "abc", "1.", ".5", "1e", "inf", "0x", '"\\q"', '"\\ud800"']) expect(valueOf(none), none).toBeNull();
});
