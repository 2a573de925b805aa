/**
 * What a preview takes for granted: in a plan all inputs are off, so a wait for a signal would be its end.
 */
import { type Document, doOf, fieldOf, fieldWith, listOf, read, write } from "./document.ts";

export interface Assumed {
  document: Document;
  /** The steps, from 0, whose signals are taken to come at once. */
  waits: number[];
}

/**
 * The program with each wait for a signal as a wait of no time. Steps keep their numbers, so a plan of it is
 * of them.
 */
export function assumed(document: Document): Assumed {
  const waits: number[] = [];
  const steps = document.steps.map((step, at) => {
    if (doOf(step) !== "wait" || fieldOf(step, "point") === undefined || fieldOf(step, "seconds") !== undefined) return step;
    waits.push(at);
    const word = step.fields.filter(({ key }) => key === "do");
    return { ...step, fields: [...word, fieldWith("seconds", 0)] };
  });
  return { document: waits.length === 0 ? document : { ...document, steps }, waits };
}

/** What is planned in place of a text: see `assumed`. */
export interface Planning {
  program: string;
  /** How many steps of the program stand before the first one that is planned. */
  skipped: number;
  /** The numbers of steps, from 1, whose signals are taken to come at once. */
  waits: number[];
}

/** A whole text to be planned. One that is not taken apart is planned as it is. */
export function planningOf(text: string): Planning {
  const result = read(text);
  return "ok" in result ? planningOfSteps(result.ok, 0) : { program: text, skipped: 0, waits: [] };
}

/** Whether a text repeats without an end, and whether it appends to what is left. The gateway refuses both. */
export function howOf(text: string): { repeats: boolean; appends: boolean } {
  const result = read(text);
  return "ok" in result ? listOf(result.ok) : { repeats: false, appends: false };
}

/** Steps to be planned, with `skipped` steps of their program before them. */
export function planningOfSteps(steps: Document, skipped: number): Planning {
  const { document, waits } = assumed(steps);
  return { program: write(document), skipped, waits: waits.map((at) => at + skipped + 1) };
}
