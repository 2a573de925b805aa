/**
 * The path of a plan, for the picture: where the tool would be, and how near the axes come to their limits.
 * Pure.
 */
import type { ArmModel, ProgramPlan } from "../api/types.ts";
import { geometric, nearness, rangeOf, stands } from "./model.ts";
import type { PathKind, PathPoint } from "./path.ts";

type Planned = Pick<ProgramPlan, "samples" | "problems">;

/** The samples of a plan as points. The last one is what ended a plan before its end. */
export function pathOf(model: ArmModel, plan: Planned): PathPoint[] {
  const ended = endOf(plan);
  return plan.samples.map(({ axes }, at) => {
    const kind = at === plan.samples.length - 1 && ended !== null ? ended : kindOf(model, axes);
    return { at: stands(model, axes).tool.at, kind };
  });
}

/** How the axes stand to their soft limits; the worst of them counts. */
export function kindOf(model: ArmModel, axes: readonly number[]): PathKind {
  const all = geometric(model, axes).map((position, axis) => nearness(position, rangeOf(model, axis)));
  return all.includes("beyond") ? "beyond" : all.includes("near") ? "near" : "ok";
}

function endOf({ problems }: Planned): PathKind | null {
  if (problems.some(({ kind }) => kind === "limit" || kind === "out_of_reach")) return "beyond";
  return problems.some(({ kind }) => kind === "singular") ? "singular" : null;
}
