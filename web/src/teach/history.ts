/** What was changed, to undo and redo it. One gesture of a person is one entry. */
import { type Command, apply } from "./commands.ts";
import type { Document } from "./document.ts";

/** Entries that are kept. Older ones cannot be undone any more. */
export const MAX_ENTRIES = 200;

/** What is chosen: a step by its place, a point by its name, or nothing. */
export type Selection = { step: number } | { point: string } | null;

interface Entry {
  redo: Command;
  undo: Command;
  before: Selection;
  after: Selection;
}

export interface History {
  document: Document;
  selection: Selection;
  readonly done: readonly Entry[];
  readonly undone: readonly Entry[];
}

export function historyOf(document: Document): History {
  return { document, selection: document.steps.length > 0 ? { step: 0 } : null, done: [], undone: [] };
}

/** Makes a change; `after` is what is chosen then. What was undone cannot be redone any more. */
export function change(history: History, command: Command, after: Selection): History {
  const { document, inverse } = apply(history.document, command);
  const entry: Entry = { redo: command, undo: inverse, before: history.selection, after };
  return { document, selection: after, done: [...history.done, entry].slice(-MAX_ENTRIES), undone: [] };
}

export function choose(history: History, selection: Selection): History {
  return { ...history, selection };
}

/** Takes the last change back, and chooses what was chosen before it. */
export function undo(history: History): History {
  const entry = history.done.at(-1);
  if (entry === undefined) return history;
  const { document } = apply(history.document, entry.undo);
  return { document, selection: entry.before, done: history.done.slice(0, -1), undone: [...history.undone, entry] };
}

export function redo(history: History): History {
  const entry = history.undone.at(-1);
  if (entry === undefined) return history;
  const { document } = apply(history.document, entry.redo);
  return { document, selection: entry.after, done: [...history.done, entry], undone: history.undone.slice(0, -1) };
}
