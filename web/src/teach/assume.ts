/**
 * What a preview takes for granted: in a plan all inputs are off, so a wait for a signal would be its end.
 */
import { fieldWith, type Document, doOf, fieldOf } from "./document.ts";

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
