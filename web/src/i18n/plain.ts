/**
 * Texts that others gave: a controller, a user, another gateway. They may hold hidden characters, and characters that
 * turn the text around them: `U+202E` shows what follows from right to left. Such characters are shown as the command
 * line shows them: `\u{202e}`.
 */

/** Control characters, format characters (they turn a text or have no width), ends of lines, and fillers. */
const HIDDEN = /[\p{Cc}\p{Cf}\p{Cs}\p{Zl}\p{Zp}\u034f\u115f\u1160\u17b4\u17b5\u3164\uffa0]/u;
const ALL_HIDDEN = new RegExp(HIDDEN, "gu");
/** Letters that are written from right to left. */
const RIGHT_TO_LEFT = /[\u0590-\u08ff\ufb1d-\ufdff\ufe70-\ufefc\u{10800}-\u{10fff}\u{1e800}-\u{1efff}]/u;
/** First strong isolate, and its end: what stands between them turns nothing outside. */
const [ISOLATE, END] = ["\u2068", "\u2069"];
/** What `plain` has isolated already. */
const ISOLATED = new RegExp(`${ISOLATE}[^${ISOLATE}${END}]*${END}`, "gu");

function mark(character: string): string {
  if (character === "\n") return "\\n";
  if (character === "\r") return "\\r";
  if (character === "\t") return "\\t";
  return `\\u{${(character.codePointAt(0) ?? 0).toString(16)}}`;
}

/** Each hidden character of a text made visible. */
export function visibly(text: string): string {
  return HIDDEN.test(text) ? text.replace(ALL_HIDDEN, mark) : text;
}

/**
 * A text of others for a sentence, an attribute or a title. Text from right to left is isolated. What was made plain
 * before stays as it is. In elements of its own, such a text is in `ui/Name.svelte`.
 */
export function plain(text: string): string {
  if (!HIDDEN.test(text)) return RIGHT_TO_LEFT.test(text) ? ISOLATE + text + END : text;
  const parts: string[] = [];
  let at = 0;
  for (const found of text.matchAll(ISOLATED)) {
    const inside = found[0].slice(1, -1);
    if (!RIGHT_TO_LEFT.test(inside) || HIDDEN.test(inside)) continue;
    parts.push(outside(text.slice(at, found.index)), found[0]);
    at = found.index + found[0].length;
  }
  return parts.length === 0 ? outside(text) : parts.join("") + outside(text.slice(at));
}

function outside(text: string): string {
  const shown = visibly(text);
  return RIGHT_TO_LEFT.test(shown) ? ISOLATE + shown + END : shown;
}

/** A text of others in the name of a file. */
export function inFileName(text: string): string {
  return text.replace(ALL_HIDDEN, "_");
}

/** A table as a file: its lines stay. */
export function plainTable(table: string): string {
  return table.split(/(\r?\n)/).map((part, at) => (at % 2 === 1 ? part : visibly(part))).join("");
}

/** Lists and objects without a class. */
function isPlain(value: unknown): value is object {
  if (typeof value !== "object" || value === null) return false;
  return Array.isArray(value) || Object.getPrototypeOf(value) === Object.prototype;
}

/** Arguments of a sentence: texts, and the fields and members of plain values, which are texts. */
function plainly<T>(value: T, depth = 0): T {
  if (typeof value === "string") return plain(value) as T;
  if (!isPlain(value) || depth > 2) return value;
  const isList = Array.isArray(value);
  let copy: Record<string, unknown> | null = null;
  for (const [key, part] of Object.entries(value)) {
    const is = plainly(part, depth + 1);
    if (is === part) continue;
    copy ??= (isList ? [...value] : { ...value }) as Record<string, unknown>;
    copy[key] = is;
  }
  return (copy ?? value) as T;
}

/** The words of a language, whose sentences have each text that they are given in plain. */
export function guarded<T extends object>(words: T): T {
  const all = Object.entries(words).map(([key, value]: [string, unknown]) => {
    if (typeof value === "function") return [key, (...given: unknown[]) => value(...given.map((one) => plainly(one)))];
    return [key, isPlain(value) ? guarded(value) : value];
  });
  return (Array.isArray(words) ? all.map(([, value]) => value) : Object.fromEntries(all)) as T;
}
