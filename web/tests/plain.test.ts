import { readFileSync, readdirSync } from "node:fs";
import { parse } from "svelte/compiler";
import { expect, test } from "vitest";
import { joined } from "../src/api/save.ts";
import { en } from "../src/i18n/en.ts";
import { guarded, inFileName, plain, plainTable, visibly } from "../src/i18n/plain.ts";
import { whoOf } from "../src/ui/who.ts";

const TURNED = "press\u202e4\u200b";
const MARKED = "press\\u{202e}4\\u{200b}";

test("characters that turn a text, or that nobody sees, are shown", () => {
  for (const make of [plain, visibly]) {
    expect(make(TURNED)).toBe(MARKED);
    expect(make("a\u0000b\u0085c\u2028d\ufeffe\u00adf\u3164g\ud800")).toBe(
      "a\\u{0}b\\u{85}c\\u{2028}d\\u{feff}e\\u{ad}f\\u{3164}g\\u{d800}",
    );
    expect(make("one\r\ntwo\tthree")).toBe("one\\r\\ntwo\\tthree");
    // A pair of isolates around nothing that needs it is as hidden as one alone.
    expect(make("a\u2068b\u2069c\u2067d")).toBe("a\\u{2068}b\\u{2069}c\\u{2067}d");
    for (const good of ["press-04", "冲压 4 号", "Größe ±5 °", "🤖", ""]) expect(make(good)).toBe(good);
  }
});

test("a text from right to left is isolated, once", () => {
  const arm = "\u05d6\u05e8\u05d5\u05e2";
  expect(plain(arm)).toBe(`\u2068${arm}\u2069`);
  expect(plain(plain(arm))).toBe(plain(arm));
  expect(plain(`a ${plain(arm)} b`)).toBe(`a ${plain(arm)} b`);
  expect(plain(`${plain(arm)} \u202e`)).toBe(`${plain(arm)} \\u{202e}`);
  // The end of an isolate that a name brings does not end that of the page.
  expect(plain(`${arm}\u2069x`)).toBe(`\u2068${arm}\\u{2069}x\u2069`);
  expect(visibly(arm)).toBe(arm);
});

test("no sentence is turned by what it is given, however deep that stands", () => {
  const words = guarded(en);
  const said = [
    words.stop.one(TURNED),
    words.lease.others(TURNED),
    words.doing({ kind: "moves", program: TURNED, left: 1 }),
    words.needs.cause({ kind: "alarm", code: 7, text: TURNED, acknowledged: null }, 1),
    words.ui.refusal({ code: "leased", message: TURNED }),
    words.control.refused(words.stop.one(TURNED), TURNED),
    whoOf({ user: null, token: 2, token_name: TURNED, role: "viewer", robot: null } as Parameters<typeof whoOf>[0], words),
  ];
  for (const text of said) {
    expect(text).toContain(MARKED);
    expect(text).not.toMatch(/[\u202e\u200b]/u);
  }
  expect(words.code).toBe("en");
  expect(words.needs.since(61)).toBe(en.needs.since(61));
});

test("a file that the page saves keeps its lines, and hides nothing", () => {
  const table = `robot,program\r\nsaw,${TURNED}\r\n`;
  expect(plainTable(table)).toBe(`robot,program\r\nsaw,${MARKED}\r\n`);
  expect(inFileName("pick\u202elmth.toml")).toBe("pick_lmth.toml");
  expect(joined([table, table])).toBe(`robot,program\r\nsaw,${MARKED}\r\nsaw,${MARKED}\r\n`);
});

interface Node {
  type?: string;
  expression?: { start: number; end: number };
}

/** The expressions that stand in a component as text. */
function texts(source: string): string[] {
  const found: string[] = [];
  const walk = (node: unknown): void => {
    if (typeof node !== "object" || node === null) return;
    if (Array.isArray(node)) return node.forEach(walk);
    const { type, expression } = node as Node;
    if (type === "Attribute") return;
    const isText = type === "ExpressionTag" && expression !== undefined;
    if (isText) found.push(source.slice(expression.start, expression.end));
    else Object.values(node).forEach(walk);
  };
  walk(parse(source, { modern: true }).fragment);
  return found;
}

/** What others give, by the last name of an expression. */
const OTHERS = new RegExp(
  `(^|[.?[])(${"robot lane holder by actor who machine_name firmware stored_by program".replaceAll(" ", "|")}|${
    "comment message detail reason remark remedy".replaceAll(" ", "|")
  })\\]?$`,
);
const NAMES = /(robot|user|view|point|one|shift|token|editor|model|program)\.name$/;
/** Made of words of the page. */
const WORDS = new Set([
  "who",
  // The unmet conditions of a control.
  "reason",
  // Of a mistake that the page itself found.
  "problem.message",
  // A share of a sum.
  "by",
]);

test("each text of others that a component shows is in `Name`", () => {
  const root = new URL("../src/", import.meta.url);
  const parts = readdirSync(root, { recursive: true, encoding: "utf8" }).filter((name) => name.endsWith(".svelte"));
  const bare = parts.flatMap((part) =>
    texts(readFileSync(new URL(part, root), "utf8"))
      .filter((text) => (OTHERS.test(text) || NAMES.test(text)) && !WORDS.has(text) && !/^(own|words)\./.test(text))
      .map((text) => `${part}: {${text}}`),
  );
  expect(parts.length).toBeGreaterThan(80);
  expect(bare).toEqual([]);
});
