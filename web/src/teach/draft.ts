/**
 * Drafts: the text of a program after each change, in this browser, so that a lost gateway or a closed page
 * loses nothing. There are few, and the oldest goes first.
 */

/** Drafts that are kept, and characters of all of them: a browser keeps about five million. */
export const MAX_DRAFTS = 20;
export const MAX_CHARACTERS = 2_000_000;

const PREFIX = "r6-draft-";

export interface Draft {
  text: string;
  /** The version that it began from; `null` if nothing was stored. */
  base: { version: number; etag: string } | null;
  /** When it was changed last, in milliseconds since 1970, by the browser's clock. */
  at: number;
}

/** What a draft is kept in: `localStorage`, or the like of it in tests. */
export type Shelf = Pick<Storage, "getItem" | "setItem" | "removeItem" | "key" | "length">;

export function readDraft(shelf: Shelf, program: string): Draft | null {
  try {
    return draftOf(shelf.getItem(PREFIX + program));
  } catch {
    return null;
  }
}

/** Keeps a draft. Returns whether it is kept: a browser may refuse, in a private window for example. */
export function keepDraft(shelf: Shelf, program: string, draft: Draft): boolean {
  try {
    const others = drafts(shelf).filter((one) => one.program !== program);
    let room = MAX_CHARACTERS - draft.text.length;
    others.forEach(({ program: name, draft: { text } }, at) => {
      room -= text.length;
      if (at >= MAX_DRAFTS - 1 || room < 0) shelf.removeItem(PREFIX + name);
    });
    shelf.setItem(PREFIX + program, JSON.stringify(draft));
    return true;
  } catch {
    return false;
  }
}

/**
 * The draft of a program as one page knows it. Two pages of a browser may change one program: neither takes the draft
 * of the other away without a word.
 */
export class Drafted {
  /** The text that this page read or kept last; `null` without one. */
  private last: string | null = null;

  constructor(
    private readonly shelf: Shelf,
    readonly program: string,
  ) {}

  read(): Draft | null {
    const draft = readDraft(this.shelf, this.program);
    this.last = draft?.text ?? null;
    return draft;
  }

  /** Whether another page has kept another draft since. */
  isOthers(text: string): boolean {
    const there = readDraft(this.shelf, this.program)?.text ?? null;
    return there !== null && there !== this.last && there !== text;
  }

  /** Whether an event of the browser's storage is of this draft. */
  isOf({ key }: Pick<StorageEvent, "key">): boolean {
    return key === PREFIX + this.program || key === null;
  }

  /** Keeps a draft. Returns whether it is kept: not over one of another page, unless `isOver`. */
  keep(draft: Draft, isOver = false): boolean {
    if (!isOver && this.isOthers(draft.text)) return false;
    const isKept = keepDraft(this.shelf, this.program, draft);
    if (isKept) this.last = draft.text;
    return isKept;
  }

  /** Drops the draft that this page kept. */
  drop(text: string): void {
    if (!this.isOthers(text)) dropDraft(this.shelf, this.program);
    this.last = null;
  }
}

export function dropDraft(shelf: Shelf, program: string): void {
  try {
    shelf.removeItem(PREFIX + program);
  } catch {
    // Nothing is kept there.
  }
}

/** All drafts, the newest first. */
export function drafts(shelf: Shelf): { program: string; draft: Draft }[] {
  const all: { program: string; draft: Draft }[] = [];
  try {
    for (let at = 0; at < shelf.length; at += 1) {
      const key = shelf.key(at);
      const draft = key?.startsWith(PREFIX) === true ? draftOf(shelf.getItem(key)) : null;
      if (key !== null && draft !== null) all.push({ program: key.slice(PREFIX.length), draft });
    }
  } catch {
    return [];
  }
  return all.sort((a, b) => b.draft.at - a.draft.at);
}

/** Other pages and older builds write there too. A text of another form is left out. */
function draftOf(text: string | null): Draft | null {
  if (text === null) return null;
  let read: unknown;
  try {
    read = JSON.parse(text);
  } catch {
    return null;
  }
  if (typeof read !== "object" || read === null || !("text" in read) || !("at" in read) || !("base" in read)) return null;
  const { text: program, at, base } = read;
  if (typeof program !== "string" || typeof at !== "number") return null;
  if (base === null) return { text: program, at, base: null };
  if (typeof base !== "object" || !("version" in base) || !("etag" in base)) return null;
  const { version, etag } = base;
  if (typeof version !== "number" || typeof etag !== "string") return null;
  return { text: program, at, base: { version, etag } };
}
