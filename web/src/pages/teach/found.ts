/** The mistakes of a check at their steps and fields. */
import type { ProgramChecked } from "../../api/types.ts";
import { type Document, locate } from "../../teach/document.ts";

export interface StepProblem {
  /** `null`: the page found it, and says it in its own language. */
  line: number | null;
  column: number | null;
  /** The field; `null` if it is about the step. */
  key: string | null;
  message: string;
  advice: string | null;
}

export interface Found {
  /** By step, from 0. */
  steps: Map<number, StepProblem[]>;
  /** Those of no step. */
  whole: { line: number | null; column: number | null; message: string; advice: string | null }[];
}

export function foundIn(document: Document, checked: ProgramChecked | null): Found {
  const found: Found = { steps: new Map(), whole: [] };
  for (const { line, column, message, advice } of checked?.problems ?? []) {
    const place = line === null ? null : locate(document, line);
    if (line === null || place === null) {
      found.whole.push({ line, column, message, advice });
      continue;
    }
    const problem: StepProblem = { line, column, key: place.key, message: bare(message), advice };
    found.steps.set(place.step, [...(found.steps.get(place.step) ?? []), problem]);
  }
  return found;
}

/** With what the page itself finds at the field `to` of steps, in its words. */
export function withOwn(found: Found, own: ReadonlyMap<number, string>): Found {
  const steps = new Map(found.steps);
  for (const [step, message] of own) {
    steps.set(step, [...(steps.get(step) ?? []), { line: null, column: null, key: "to", message, advice: null }]);
  }
  return { ...found, steps };
}

/** A message without the step that it names: it stands beside its step, and may count from another first step. */
export function bare(message: string): string {
  return message.replace(/^(?:program `program`, )?(?:instruction|step) \d+(?: \([^()]*\))?:? /, "");
}
