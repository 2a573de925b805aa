/** The present position of an arm as a point: only if it is one of now, and the arm stands. */
import type { Queried } from "../api/types.ts";

/** Why there is no point. */
export type NoPoint = "no_answer" | "not_fresh" | "moving" | "moving_unknown" | "robot" | "no_axes";

/** The most axes of a robot. */
export const MAX_AXES = 8;

/** What is asked for, in one question: position and rest are of one time. */
export function addresses(): string {
  const axes = Array.from({ length: MAX_AXES }, (_, at) => `axis-${at}`);
  const pose = Array.from({ length: 6 }, (_, at) => `world-${at}`);
  return ["isMoving", ...axes, ...pose].join(",");
}

/**
 * The point of an answer. `axes` is how many axes the robot says that it has. Numbers are as exact as the
 * wire.
 */
export function pointOf(
  queried: Queried,
  axes: number | null,
): { axes: number[]; pose: number[] | null } | { not: NoPoint } {
  const known = new Map(queried.signals.map((signal) => [signal.address, signal]));
  const moving = known.get("isMoving");
  if (moving?.quality !== "fresh" || typeof moving.value !== "boolean") return { not: "moving_unknown" };
  if (moving.value) return { not: "moving" };
  const numbers = (name: string, count: number): number[] | "not_fresh" => {
    const all: number[] = [];
    for (let at = 0; at < count; at += 1) {
      const signal = known.get(`${name}-${at}`);
      if (signal === undefined || signal.value === null) break;
      if (signal.quality !== "fresh" || typeof signal.value !== "number") return "not_fresh";
      // -0 is 0.
      all.push(Math.round(signal.value * 1000) / 1000 + 0);
    }
    return all;
  };
  const of = numbers("axis", axes ?? MAX_AXES);
  const pose = numbers("world", 6);
  if (of === "not_fresh" || pose === "not_fresh") return { not: "not_fresh" };
  // A robot that tells some of its axes only is not read whole.
  if (of.length === 0 || (axes !== null && of.length < axes)) return { not: "no_axes" };
  return { axes: of, pose: pose.length === 6 ? pose : null };
}
