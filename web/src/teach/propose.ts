/** Which point a new step is offered: people take points in the order in which the arm goes to them. */
import { type Document, type Point, type Step, doOf, linked, pointsOf, wants } from "./document.ts";

/** The names of the points that a step moves to. */
export function pointsIn(document: Document, step: Step): string[] {
  return step.fields.flatMap(({ key }) => {
    const name = linked(document, step, key)?.name;
    return name === undefined ? [] : [name];
  });
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
  const last = lastPoint(document, before);
  const at = points.findIndex(({ name }) => name === last);
  return (at < 0 ? undefined : points[at + 1]) ?? points.at(-1) ?? null;
}

/** The point that the arm comes from: steps such as outputs do not move it. */
function lastPoint(document: Document, before: number | null): string | null {
  if (before === null) return null;
  const steps = document.steps.slice(0, before + 1);
  const last = steps.findLast((step) => step.fields.some(({ key }) => wants(doOf(step), key) !== null));
  return last === undefined ? null : (linked(document, last, "to")?.name ?? null);
}
