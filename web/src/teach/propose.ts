/** Which point a new step is offered: people take points in the order in which the arm goes to them. */
import { type Document, type Point, type Step, doOf, linked, pointsOf, wants } from "./document.ts";

/** The names of the points that a step moves to. */
export function pointsIn(document: Document, step: Step): string[] {
  return step.fields.flatMap(({ key }) => {
    const name = linked(document, step, key)?.name;
    return name === undefined ? [] : [name];
  });
}

/**
 * The point that the arm stands at when a step, from 0, is carried out: that of its own move, or of the last one before.
 * `null` if there is none, or if that move has numbers of its own.
 */
export function standsAt(document: Document, step: number): Point | null {
  const moves = document.steps.slice(0, step + 1);
  const last = moves.findLast((one) => one.fields.some(({ key }) => wants(doOf(one), key) !== null));
  return last === undefined ? null : linked(document, last, "to");
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
  const last = before === null ? null : standsAt(document, before);
  const at = points.findIndex(({ name }) => name === last?.name);
  return (at < 0 ? undefined : points[at + 1]) ?? points.at(-1) ?? null;
}
