/** Which point a new step is offered: people take points in the order in which the arm goes to them. */
import { type Document, type Point, type Step, doOf, linked, pointsOf, wants } from "./document.ts";

/** The names of the points that a step moves to. */
export function pointsIn(document: Document, step: Step): string[] {
  return step.fields.flatMap(({ key }) => {
    const name = linked(document, step, key)?.name;
    return name === undefined ? [] : [name];
  });
}

/** Steps that do not move the arm, and behind which the step below them comes. */
const STILL: ReadonlySet<string> = new Set([
  "wait",
  "output",
  "board-output",
  "stop-on-signal",
  "path-speed",
  "photo",
  "take-point",
  "counter",
  "register",
  "wait-for-registers",
]);

/**
 * The point that the arm stands at when a step, from 0, is carried out: that of its own move, or of the last one before.
 * `null` if that is not told by the steps: a move with numbers of its own or to registers, a label that is jumped to.
 */
export function standsAt(document: Document, step: number): Point | null {
  for (let at = step; at >= 0; at -= 1) {
    const one = document.steps[at];
    if (one === undefined) return null;
    if (isMove(one)) return linked(document, one, "to");
    if (!STILL.has(doOf(one))) return null;
  }
  return null;
}

function isMove(step: Step): boolean {
  return step.fields.some(({ key }) => wants(doOf(step), key) !== null);
}

/** How many steps move to a point. */
export function usesOf(document: Document, name: string): number {
  return document.steps.filter((step) => pointsIn(document, step).includes(name)).length;
}

/**
 * The point for a new move that goes behind the step `before`, from 0; `null`: at the beginning. The first point that
 * no step uses yet, else the one after the point of the step before, else the last one. `wanted`: what it has to have.
 * `null` if no point has that.
 */
export function proposed(document: Document, before: number | null, wanted: "axes" | "pose"): Point | null {
  const points = pointsOf(document).filter((point) => point[wanted] !== null);
  const used = new Set(document.steps.flatMap((step) => pointsIn(document, step)));
  const unused = points.find(({ name }) => !used.has(name));
  if (unused !== undefined) return unused;
  const last = before === null ? undefined : document.steps.slice(0, before + 1).findLast(isMove);
  const from = last === undefined ? null : linked(document, last, "to");
  const at = points.findIndex(({ name }) => name === from?.name);
  return (at < 0 ? undefined : points[at + 1]) ?? points.at(-1) ?? null;
}
