/**
 * Values of TOML as the files of programs have them: numbers, texts, true and false, and lists of them. What
 * else TOML has is refused with its place, because it could not be shown and changed one field at a time.
 */

export type Value = number | string | boolean | Value[];

/**
 * Something that is not understood, and where. Lines and columns are counted from 1, columns in characters.
 */
export interface Wrong {
  line: number;
  column: number;
  what: Refused;
}

/** Why a text is refused. */
export type Refused =
  | "frames"
  | "too_long"
  | "header"
  | "key"
  | "twice"
  | "no_step"
  | "value"
  | "long_text"
  | "table_value"
  | "date"
  | "open_text"
  | "open_list"
  | "too_deep"
  | "behind";

export class Refusal extends Error {
  constructor(
    readonly at: number,
    readonly what: Refused,
  ) {
    super(what);
  }
}

/** Lists in lists in programs are two deep at most. */
const MAX_DEPTH = 4;

const NUMBER = /^[+-]?(?:0|[1-9](?:_?\d)*)(?:\.\d(?:_?\d)*)?(?:[eE][+-]?\d(?:_?\d)*)?(?![\w.:-])/;
const HEX = /^0(?:x[0-9a-fA-F](?:_?[0-9a-fA-F])*|o[0-7](?:_?[0-7])*|b[01](?:_?[01])*)(?!\w)/;
const DATE = /^\d{4}-\d\d-\d\d|^\d\d:\d\d/;
const ESCAPES: Record<string, string> = { b: "\b", t: "\t", n: "\n", f: "\f", r: "\r", '"': '"', "\\": "\\" };

/** Reads a value at an offset. Returns it, and the offset behind it. Throws a refusal. */
export function readValue(text: string, at: number, depth = 0): { value: Value; end: number } {
  const rest = text.slice(at, at + 100);
  const first = rest[0];
  if (first === '"' || first === "'") return readText(text, at);
  if (first === "[") return readList(text, at, depth);
  if (first === "{") throw new Refusal(at, "table_value");
  const flag = /^(true|false)(?!\w)/.exec(rest)?.[1];
  if (flag !== undefined) return { value: flag === "true", end: at + flag.length };
  if (DATE.test(rest)) throw new Refusal(at, "date");
  const number = HEX.exec(rest)?.[0] ?? NUMBER.exec(rest)?.[0];
  if (number === undefined) throw new Refusal(at, "value");
  const value = Number(number.replaceAll("_", ""));
  if (!Number.isFinite(value)) throw new Refusal(at, "value");
  return { value, end: at + number.length };
}

function readText(text: string, at: number): { value: string; end: number } {
  const quote = text[at]!;
  if (text.startsWith(quote.repeat(3), at)) throw new Refusal(at, "long_text");
  let value = "";
  for (let here = at + 1; here < text.length; here += 1) {
    const character = text[here]!;
    if (character === quote) return { value, end: here + 1 };
    // Control characters do not stand in a text.
    if (character !== "\t" && (character < " " || character === "\u007f")) break;
    if (character !== "\\" || quote === "'") {
      value += character;
      continue;
    }
    const code = /^(?:u([0-9a-fA-F]{4})|U([0-9a-fA-F]{8}))/.exec(text.slice(here + 1, here + 10));
    const plain = ESCAPES[text[here + 1] ?? ""];
    if (code !== null) {
      const point = Number.parseInt(code[1] ?? code[2]!, 16);
      if (point > 0x10ffff || (point >= 0xd800 && point <= 0xdfff)) throw new Refusal(here, "value");
      value += String.fromCodePoint(point);
      here += code[0].length;
    } else if (plain !== undefined) {
      value += plain;
      here += 1;
    } else {
      throw new Refusal(here, "value");
    }
  }
  throw new Refusal(at, "open_text");
}

function readList(text: string, at: number, depth: number): { value: Value[]; end: number } {
  if (depth >= MAX_DEPTH) throw new Refusal(at, "too_deep");
  const list: Value[] = [];
  let here = skip(text, at + 1);
  while (text[here] !== "]") {
    if (here >= text.length) throw new Refusal(at, "open_list");
    const { value, end } = readValue(text, here, depth + 1);
    list.push(value);
    here = skip(text, end);
    if (text[here] === ",") here = skip(text, here + 1);
    else if (text[here] !== "]") throw new Refusal(here >= text.length ? at : here, here >= text.length ? "open_list" : "value");
  }
  return { value: list, end: here + 1 };
}

/** Goes behind blanks, ends of lines and comments within a list. */
function skip(text: string, at: number): number {
  const gap = /(?:[ \t\r\n]|#[^\n]*)*/y;
  gap.lastIndex = at;
  gap.exec(text);
  return gap.lastIndex;
}

/** Writes a value. Numbers are written as people write them: a program has no need of more than 17 digits. */
export function writeValue(value: Value): string {
  if (typeof value === "string") return writeText(value);
  if (Array.isArray(value)) return `[${value.map(writeValue).join(", ")}]`;
  if (typeof value === "boolean") return String(value);
  if (!Number.isFinite(value)) throw new Error("a program has finite numbers only");
  // 1e+21 has no point before its exponent in TOML either; -0 would be read as 0.
  return Object.is(value, -0) ? "0" : String(value).replace("e+", "e");
}

function writeText(text: string): string {
  const escaped = text.replaceAll(/["\\\u0000-\u001f\u007f]/g, (character) => {
    if (character === '"' || character === "\\") return `\\${character}`;
    return `\\u${character.charCodeAt(0).toString(16).padStart(4, "0")}`;
  });
  return `"${escaped}"`;
}

/** Reads a whole text as one value; `null` if it is not a value. */
export function valueOf(text: string): Value | null {
  try {
    const { value, end } = readValue(text.trim(), 0);
    return end === text.trim().length ? value : null;
  } catch {
    return null;
  }
}

/** Line and column of an offset, both counted from 1, columns in characters. */
export function placeOf(text: string, at: number): { line: number; column: number } {
  const before = text.slice(0, at);
  const start = before.lastIndexOf("\n") + 1;
  return { line: before.split("\n").length, column: [...before.slice(start)].length + 1 };
}
