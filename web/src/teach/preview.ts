/**
 * What a plan of the gateway shows: where it is near or beyond a limit, and where the arm is at an instant. The
 * gateway alone computes with arms. Whether it still holds: `run/guard.ts`.
 */
import type { PlanSample, ProgramPlan } from "../api/types.ts";
import { nearness } from "../scene/model.ts";

/** A part of a path. `beyond` and `singular` are where the plan ends for that reason. */
export type Mark = "ok" | "near" | "beyond" | "singular";

type Axis = ProgramPlan["axes"][number];

/** How far a value is from the nearer limit; below 0 if it is beyond. */
function room(value: number, [low = -Infinity, high = Infinity]: readonly number[]): number {
  return Math.min(value - low, high - value);
}

/** The same as on the page of the robot. */
function isNear(value: number, { limits: [low = 0, high = 0] }: Axis): boolean {
  return nearness(value, [low, high]) !== "inside";
}

/** The mark of each sample. */
export function marksOf(plan: ProgramPlan): Mark[] {
  const end = badEnd(plan);
  return plan.samples.map((sample, at): Mark => {
    if (end !== null && (sample.time_ms >= end.at_ms || at === plan.samples.length - 1)) return end.mark;
    return plan.axes.some((axis, index) => isNear(sample.axes[index] ?? 0, axis)) ? "near" : "ok";
  });
}

/** The limit or singularity that ends the plan; `null` if none does. */
export function badEnd(plan: ProgramPlan): { at_ms: number; mark: "beyond" | "singular"; step: number | null } | null {
  for (const { kind, at_ms, step } of plan.problems) {
    if (kind === "limit" || kind === "out_of_reach") return { at_ms, step, mark: "beyond" };
    if (kind === "singular") return { at_ms, step, mark: "singular" };
  }
  return null;
}

/** Where an axis comes nearest to one of its limits, if that is near. The nearest comes first. */
export interface Nearness {
  axis: string;
  unit: string;
  value: number;
  limit: number;
  room: number;
  time_ms: number;
  /** The number of the step, from 1; `null` if that is not known. */
  step: number | null;
}

export function nearLimits(plan: ProgramPlan): Nearness[] {
  return plan.axes
    .flatMap((axis, index): Nearness[] => {
      let least: PlanSample | null = null;
      const of = (sample: PlanSample): number => room(sample.axes[index] ?? 0, axis.limits);
      for (const sample of plan.samples) if (least === null || of(sample) < of(least)) least = sample;
      const value = least?.axes[index];
      if (least === null || value === undefined || !isNear(value, axis)) return [];
      const [low = 0, high = 0] = axis.limits;
      const limit = value - low < high - value ? low : high;
      const { time_ms } = least;
      return [{ axis: axis.name, unit: axis.unit, value, limit, room: of(least), time_ms, step: stepAt(plan, time_ms) }];
    })
    .sort((a, b) => a.room - b.room);
}

/** The number of the step that runs at a time; `null` before the first one. */
export function stepAt(plan: ProgramPlan, time: number): number | null {
  let number: number | null = null;
  for (const step of plan.steps) if (step.begin_ms <= time) number = step.number;
  return number;
}

/** The worst mark of each step, by its number from 1. */
export function stepMarks(plan: ProgramPlan): Map<number, Mark> {
  const marks = new Map<number, Mark>();
  const all = marksOf(plan);
  const rank: Mark[] = ["ok", "near", "singular", "beyond"];
  plan.samples.forEach(({ time_ms }, at) => {
    const step = stepAt(plan, time_ms);
    const mark = all[at] === "near" ? "near" : "ok";
    if (step !== null && rank.indexOf(mark) > rank.indexOf(marks.get(step) ?? "ok")) marks.set(step, mark);
  });
  const end = badEnd(plan);
  if (end?.step != null) marks.set(end.step, end.mark);
  return marks;
}

/**
 * The arm at a time: the axes between two samples, the pose of the sample before. The last sample holds on.
 */
export function armAt(plan: ProgramPlan, time: number): { sample: PlanSample; axes: number[] } | null {
  const { samples } = plan;
  let [low, high] = [0, samples.length - 1];
  while (low < high) {
    const middle = Math.ceil((low + high) / 2);
    if (samples[middle]!.time_ms <= time) low = middle;
    else high = middle - 1;
  }
  const sample = samples[low];
  if (sample === undefined) return null;
  const next = samples[low + 1];
  if (next === undefined || next.time_ms <= sample.time_ms || time <= sample.time_ms) return { sample, axes: sample.axes };
  const part = (time - sample.time_ms) / (next.time_ms - sample.time_ms);
  return { sample, axes: sample.axes.map((value, at) => value + ((next.axes[at] ?? value) - value) * part) };
}
