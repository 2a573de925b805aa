/**
 * Moves of axes that a robot does not have. The gateway's check knows no robot. It refuses the plan and the run: here
 * the mistake stands beside its step before that.
 */
import { type Document, doOf, numbers, valueAt } from "./document.ts";

/** How many axes a robot has, by what its controller tells and by its model: the fewer, if both are known. */
export function axesBy(told: number | null | undefined, ofModel: number | null | undefined): number | null {
  const known = [told, ofModel].filter((count) => typeof count === "number" && count > 0) as number[];
  return known.length === 0 ? null : Math.min(...known);
}

/** Which axes a mask has: `"0x3F"`, or a number. Without one, all that a move has numbers of. */
function isIn(mask: unknown, axis: number): boolean {
  const bits = typeof mask === "string" || typeof mask === "number" ? Number(mask) : Number.NaN;
  return !Number.isInteger(bits) || ((bits >> axis) & 1) === 1;
}

/**
 * The steps, from 0, that move an axis which a robot with so many axes lacks, and these axes, from 0. Zeros are allowed,
 * as the gateway allows them: people write all six.
 */
export function beyondAxes(document: Document, count: number | null): Map<number, number[]> {
  const found = new Map<number, number[]>();
  if (count === null) return found;
  document.steps.forEach((step, at) => {
    if (doOf(step) !== "axis-move") return;
    const mask = valueAt(step, "mask");
    const to = numbers(valueAt(step, "to")) ?? [];
    const beyond = to.flatMap((place, axis) => (axis >= count && place !== 0 && isIn(mask, axis) ? [axis] : []));
    if (beyond.length > 0) found.set(at, beyond);
  });
  return found;
}
