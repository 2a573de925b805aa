/**
 * A program as the page shows and changes it: points by name, and steps. It is read from, and written as, the
 * text that `r6 run` takes. Every part that is not changed keeps its text, so a text that was read is written
 * as it was, with its comments. What is not understood is refused with its place.
 *
 * A point is a comment at the top: `# point "above" = axes [0, 10, -20, 0, -80, 0] pose [360, -50, 500, 180,
 * 0, 180]`. A move to it has its numbers, and the comment `# point "above"` behind them. So `r6 run` needs to
 * know nothing of points, and a move whose numbers are others than those of its point is not taken for a move
 * to it.
 */
import { type Value, type Wrong, Refusal, placeOf, readValue, valueOf, writeValue } from "./toml.ts";

/** The longest text of a program, as the gateway has it, in bytes. */
export const MAX_TEXT = 256 * 1024;
/** The longest name of a point, in characters. */
export const MAX_NAME = 32;

export interface Point {
  name: string;
  /** J1 first, degrees or mm; `null` if they are not known. */
  axes: readonly number[] | null;
  /** X, Y, Z in mm, U, V, W in degrees; `null` if it is not known. */
  pose: readonly number[] | null;
}

export interface Field {
  key: string;
  value: Value;
  /** The line or lines of it, with their ends: blanks, comment and all. */
  text: string;
}

export type Table = "instruction" | "step";

export interface Step {
  /** Stays the same while the step is moved and changed. */
  readonly id: number;
  table: Table;
  /** What stands before it: comments, empty lines, and tables of a taught program that are no steps. */
  before: string;
  /** The line `[[instruction]]`. */
  head: string;
  /** In the order of the text. Comments between them are in `text` of the field behind them. */
  fields: readonly Field[];
}

/** A line at the top: a point, or something else that is kept. */
export interface TopLine {
  text: string;
  point: Point | null;
}

export interface Document {
  top: readonly TopLine[];
  steps: readonly Step[];
  /** What stands behind the last step. */
  tail: string;
}

export const EMPTY: Document = { top: [], steps: [], tail: "" };

let lastId = 0;

/** The number of a new step. */
export function newId(): number {
  return (lastId += 1);
}

const POINT = /^# point ("(?:[^"\\]|\\.)*") =(?: axes (\[[^\]]*\]))?(?: pose (\[[^\]]*\]))?[ \t]*$/;
const OF_POINT = /#[ \t]*point ("(?:[^"\\]|\\.)*")[ \t]*$/;

/** Reads a text. Never throws: a text that is not understood is returned with the place. */
export function read(text: string): { ok: Document } | { wrong: Wrong } {
  try {
    return { ok: readAll(text) };
  } catch (error) {
    if (!(error instanceof Refusal)) throw error;
    return { wrong: { ...placeOf(text, error.at), what: error.what } };
  }
}

function readAll(text: string): Document {
  if (new TextEncoder().encode(text).length > MAX_TEXT) throw new Refusal(0, "too_long");
  if (/^\uFEFF?\s*(?:\{|\/\/)/.test(text)) throw new Refusal(text.search(/\S/), "frames");
  const top: TopLine[] = [];
  const steps: { step: Step; fields: Field[] }[] = [];
  // What was read and belongs to what comes next.
  let before = "";
  // Where lines go: `top` until the first table, then a step, or a table that is kept as it is.
  let place: "top" | "step" | "other" = "top";
  let keys = new Set<string>();
  let at = 0;
  while (at < text.length) {
    const newline = text.indexOf("\n", at);
    let end = newline < 0 ? text.length : newline + 1;
    const line = text.slice(at, end);
    const bare = line.trim();
    const indent = line.length - line.trimStart().length;
    if (bare === "" || bare.startsWith("#")) {
      if (place === "top") top.push({ text: line, point: pointOf(bare) });
      else before += line;
    } else if (bare.startsWith("[")) {
      const name = /^\[\[\s*(instruction|step|stack|counter)\s*\]\]\s*(?:#.*)?$/.exec(bare)?.[1];
      if (name === undefined) throw new Refusal(at + indent, "header");
      keys = new Set();
      if (name === "instruction" || name === "step") {
        const fields: Field[] = [];
        steps.push({ step: { id: newId(), table: name, before, head: line, fields }, fields });
        before = "";
        place = "step";
      } else {
        before += line;
        place = "other";
      }
    } else {
      const name = /^([A-Za-z0-9_-]+)[ \t]*=[ \t]*/.exec(line.slice(indent));
      if (name === null) throw new Refusal(at + indent, "key");
      const key = name[1]!;
      if (keys.has(key)) throw new Refusal(at + indent, "twice");
      keys.add(key);
      const read = readValue(text, at + indent + name[0].length);
      const behind = text.indexOf("\n", read.end);
      end = behind < 0 ? text.length : behind + 1;
      if (!/^[ \t]*(?:#[^\n]*)?\r?\n?$/.test(text.slice(read.end, end))) throw new Refusal(read.end, "behind");
      const own = text.slice(at, end);
      const last = steps.at(-1);
      if (place === "step" && last !== undefined) {
        last.fields.push({ key, value: read.value, text: before + own });
        before = "";
      } else if (place === "top") {
        top.push({ text: own, point: null });
      } else {
        before += own;
      }
    }
    at = end;
  }
  // A text without an end of its last line gets one when something is added behind it.
  return { top: top, steps: steps.map(({ step }) => step), tail: before };
}

function pointOf(line: string): Point | null {
  const match = POINT.exec(line);
  const name = match === null ? null : valueOf(match[1]!);
  if (match === null || typeof name !== "string" || (match[2] ?? match[3]) === undefined) return null;
  const axes = match[2] === undefined ? null : numbers(valueOf(match[2]));
  const pose = match[3] === undefined ? null : numbers(valueOf(match[3]));
  const isWhole = (match[2] === undefined) === (axes === null) && (match[3] === undefined) === (pose === null);
  return isWhole ? { name, axes, pose } : null;
}

/** The value as numbers; `null` if it is something else. */
export function numbers(value: Value | null | undefined): number[] | null {
  if (!Array.isArray(value) || value.length === 0) return null;
  return value.every((one) => typeof one === "number") ? value : null;
}

/** The text of a document. */
export function write(document: Document): string {
  return parts(document)
    .map(({ text }) => text)
    .join("");
}

/** The texts of a document in their order, and which part each is of. */
function parts({ top, steps, tail }: Document): { text: string; step: number | null; key: string | null }[] {
  const all: { text: string; step: number | null; key: string | null }[] = [];
  const add = (text: string, step: number | null, key: string | null): void => {
    const last = all.at(-1);
    // A line that stood at the end of its text has no end.
    if (last !== undefined && last.text !== "" && text !== "" && !last.text.endsWith("\n")) last.text += "\n";
    if (text !== "") all.push({ text, step, key });
  };
  for (const line of top) add(line.text, null, null);
  steps.forEach((step, at) => {
    add(step.before, null, null);
    add(step.head, at, null);
    for (const field of step.fields) add(field.text, at, field.key);
  });
  add(tail, null, null);
  return all;
}

/**
 * The step, counted from 0, and the field that stand at a line of the written text; `null` outside of steps.
 */
export function locate(document: Document, line: number): { step: number; key: string | null } | null {
  let first = 1;
  for (const part of parts(document)) {
    const next = first + part.text.split("\n").length - 1;
    if (line >= first && line < next + (part.text.endsWith("\n") ? 0 : 1)) {
      return part.step === null ? null : { step: part.step, key: part.key };
    }
    first = next;
  }
  return null;
}

export function pointsOf(document: Document): Point[] {
  return document.top.flatMap(({ point }) => (point === null ? [] : [point]));
}

export function fieldOf(step: Step, key: string): Field | undefined {
  return step.fields.find((field) => field.key === key);
}

export function valueAt(step: Step, key: string): Value | undefined {
  return fieldOf(step, key)?.value;
}

/** What a step does, the word of its `do`; empty without one. */
export function doOf(step: Step): string {
  const word = valueAt(step, "do");
  return typeof word === "string" ? word : "";
}

/**
 * What a program says of its whole list: whether it repeats without an end, whether it appends to what is
 * left.
 */
export function listOf(document: Document): { repeats: boolean; appends: boolean } {
  const says = (key: string): boolean =>
    document.top.some(({ text }) => new RegExp(`^\\s*${key}\\s*=\\s*true\\b`).test(text));
  return { repeats: says("repeat"), appends: says("append") };
}

/** Whether only a controller runs the program. */
export function isTaught(document: Document): boolean {
  return document.steps.some((step) => step.table === "step");
}

/** Which numbers of a point a field of a step has: those of its axes or its pose. */
export function wants(word: string, key: string): "axes" | "pose" | null {
  if (key === "to" && word === "axis-move") return "axes";
  if ((key === "to" && (word === "linear-move" || word === "curve-move")) || (key === "through" && word === "curve-move")) {
    return "pose";
  }
  return null;
}

/** The name in the comment of a field, whether there is such a point or not. */
export function named(field: Field): string | null {
  const lines = field.text.trimEnd();
  const match = OF_POINT.exec(lines);
  const name = match === null ? null : valueOf(match[1]!);
  return typeof name === "string" ? name : null;
}

/**
 * The point that a field has the numbers of; `null` if it has numbers of its own, also beside the name of a
 * point.
 */
export function linked(document: Document, step: Step, key: string): Point | null {
  const field = fieldOf(step, key);
  const kind = wants(doOf(step), key);
  const name = field === undefined ? null : named(field);
  if (field === undefined || kind === null || name === null) return null;
  const point = pointsOf(document).find((one) => one.name === name);
  const own = numbers(field.value);
  const of = point?.[kind] ?? null;
  if (point === undefined || own === null || of === null || own.length > of.length) return null;
  // A linear move may have X, Y, Z alone.
  const isWhole = own.length === of.length || (kind === "pose" && own.length === 3);
  return isWhole && own.every((number, at) => number === of[at]) ? point : null;
}

/** The line of a point. */
export function pointLine({ name, axes, pose }: Point): TopLine {
  const part = (word: string, of: readonly number[] | null): string => (of === null ? "" : ` ${word} ${writeValue([...of])}`);
  return { text: `# point ${writeValue(name)} =${part("axes", axes)}${part("pose", pose)}\n`, point: { name, axes, pose } };
}

/**
 * A field with a new value; `point` is the name of the point that the value is of. Comments before it are
 * kept.
 */
export function fieldWith(key: string, value: Value, before?: Field, point: string | null = null): Field {
  const { leading, comment } = before === undefined ? { leading: "", comment: "" } : kept(before);
  const comments = [comment, point === null ? "" : `# point ${writeValue(point)}`].filter((one) => one !== "");
  return { key, value, text: `${leading}${[`${key} = ${writeValue(value)}`, ...comments].join(" ")}\n` };
}

/** What stays of a field when it gets another value: its comments. Those within a list come before it. */
function kept(field: Field): { leading: string; comment: string } {
  const begin = new RegExp(`^[ \\t]*${field.key}[ \\t]*=[ \\t]*`, "m").exec(field.text);
  if (begin === null) return { leading: "", comment: "" };
  const from = begin.index + begin[0].length;
  const { end } = readValue(field.text, from);
  const within = field.text.slice(from, end);
  const inner = within.includes("\n") ? (within.match(/#[^\n]*/g) ?? []) : [];
  const leading = field.text.slice(0, begin.index) + inner.map((comment) => `${comment.trimEnd()}\n`).join("");
  return { leading, comment: field.text.slice(end).trim().replace(OF_POINT, "").trim() };
}

/** A new step. Values of `to` and `through` may be those of points. */
export function newStep(
  table: Table,
  fields: readonly { key: string; value: Value; point?: string | null }[],
): Step {
  return {
    id: newId(),
    table,
    before: "\n",
    head: `[[${table}]]\n`,
    fields: fields.map(({ key, value, point }) => fieldWith(key, value, undefined, point ?? null)),
  };
}

/** A part of the program with these steps alone, from 0, `end` behind the last. Its points stay in it. */
export function cut(document: Document, begin: number, end: number): Document {
  return { ...document, steps: document.steps.slice(begin, end) };
}
