/**
 * Changes of a program, as values. `apply` makes a change and returns the change that takes it back. Nothing
 * is changed in place.
 */
import {
  type Document,
  type Field,
  type Point,
  type Step,
  type TopLine,
  doOf,
  fieldWith,
  linked,
  newId,
  newStep,
  pointLine,
  pointsOf,
  wants,
} from "./document.ts";
import { firstFreeName } from "./free.ts";
import { standsAt } from "./propose.ts";

export type Command =
  | { kind: "insert"; at: number; steps: readonly Step[] }
  | { kind: "remove"; at: number; count: number }
  /** The step at `from` stands at `to` afterwards. */
  | { kind: "move"; from: number; to: number }
  | { kind: "change"; at: number; step: Step }
  /** The lines at the top: points are taken, changed, renamed and removed there. */
  | { kind: "top"; top: readonly TopLine[] }
  /** Another text altogether: an older version, the one of somebody else, a file. */
  | { kind: "replace"; document: Document }
  /** Several changes that are one for a person. */
  | { kind: "all"; commands: readonly Command[] };

export interface Applied {
  document: Document;
  inverse: Command;
}

/** Makes a change. Throws if it names steps that are not there: a mistake of the page. */
export function apply(document: Document, command: Command): Applied {
  const { steps } = document;
  switch (command.kind) {
    case "insert": {
      const { at } = command;
      if (at < 0 || at > steps.length) throw new Error(`there is no place ${at}`);
      const inverse: Command = { kind: "remove", at, count: command.steps.length };
      return { document: { ...document, steps: [...steps.slice(0, at), ...command.steps, ...steps.slice(at)] }, inverse };
    }
    case "remove": {
      const { at, count } = command;
      if (at < 0 || count < 1 || at + count > steps.length) throw new Error(`there are no ${count} steps at ${at}`);
      const inverse: Command = { kind: "insert", at, steps: steps.slice(at, at + count) };
      return { document: { ...document, steps: [...steps.slice(0, at), ...steps.slice(at + count)] }, inverse };
    }
    case "move": {
      const { from, to } = command;
      const step = steps[from];
      if (step === undefined || steps[to] === undefined) throw new Error(`there is no step ${from} or ${to}`);
      const others = steps.filter((_, at) => at !== from);
      const moved = [...others.slice(0, to), step, ...others.slice(to)];
      return { document: { ...document, steps: moved }, inverse: { kind: "move", from: to, to: from } };
    }
    case "change": {
      const { at, step } = command;
      const before = steps[at];
      if (before === undefined) throw new Error(`there is no step ${at}`);
      return { document: { ...document, steps: steps.with(at, step) }, inverse: { kind: "change", at, step: before } };
    }
    case "top":
      return { document: { ...document, top: command.top }, inverse: { kind: "top", top: document.top } };
    case "replace":
      return { document: command.document, inverse: { kind: "replace", document } };
    case "all": {
      const inverses: Command[] = [];
      let now = document;
      for (const one of command.commands) {
        const applied = apply(now, one);
        now = applied.document;
        inverses.unshift(applied.inverse);
      }
      return { document: now, inverse: { kind: "all", commands: inverses } };
    }
  }
}

/** A copy of steps, with numbers of their own. */
export function copied(steps: readonly Step[]): Step[] {
  return steps.map((step) => ({ ...step, id: newId() }));
}

/** A step with a field that has another value, or a new field. */
export function withField(step: Step, field: Field): Step {
  const at = step.fields.findIndex((one) => one.key === field.key);
  return { ...step, fields: at < 0 ? [...step.fields, field] : step.fields.with(at, field) };
}

export function withoutField(step: Step, key: string): Step {
  return { ...step, fields: step.fields.filter((field) => field.key !== key) };
}

/** Puts a new point behind the others, or changes or renames one; moves to it go with it. */
export function putPoint(document: Document, name: string | null, point: Point): Command {
  const at = name === null ? -1 : document.top.findIndex((line) => line.point?.name === name);
  if (at < 0) {
    // Behind the last point; the first one goes behind what stands at the top.
    const last = document.top.findLastIndex((line) => line.point !== null);
    const place = last < 0 ? document.top.length : last + 1;
    return { kind: "top", top: [...document.top.slice(0, place), pointLine(point), ...document.top.slice(place)] };
  }
  const changes = document.steps.flatMap((step, number): Command[] => {
    const changed = movedWith(document, step, name!, point);
    return changed === step ? [] : [{ kind: "change", at: number, step: changed }];
  });
  return { kind: "all", commands: [{ kind: "top", top: document.top.with(at, pointLine(point)) }, ...changes] };
}

/**
 * A step after a point that it moves to has changed. Numbers that the point does not have any more are the
 * step's own.
 */
function movedWith(document: Document, step: Step, name: string, point: Point): Step {
  let now = step;
  for (const field of step.fields) {
    const kind = wants(doOf(step), field.key);
    if (kind === null || linked(document, step, field.key)?.name !== name) continue;
    const of = point[kind];
    const own = field.value as number[];
    const value = of === null ? own : of.slice(0, own.length);
    now = withField(now, fieldWith(field.key, [...value], field, of === null ? null : point.name));
  }
  return now;
}

/** Takes a point away. Moves to it keep its numbers as their own. */
export function removePoint(document: Document, name: string): Command {
  const top = document.top.filter((line) => line.point?.name !== name);
  const none: Point = { name, axes: null, pose: null };
  const changes = document.steps.flatMap((step, at): Command[] => {
    const changed = movedWith(document, step, name, none);
    return changed === step ? [] : [{ kind: "change", at, step: changed }];
  });
  return { kind: "all", commands: [{ kind: "top", top }, ...changes] };
}

/** A name that no point has: `P1`, `P2`. */
export function freeName(document: Document): string {
  return firstFreeName("P", pointsOf(document).map(({ name }) => name));
}

/** The speed of a new move, in percent. */
const MOVE_SPEED = 20;

/** A new move to a point: an axis move, or a linear one if only the pose of the point is known. */
export function moveTo(document: Document, { name, axes, pose }: Point): Step {
  return newStep(document.steps[0]?.table ?? "instruction", [
    { key: "do", value: axes === null ? "linear-move" : "axis-move" },
    { key: "to", value: [...(axes ?? pose ?? [])], point: name },
    { key: "speed", value: MOVE_SPEED },
  ]);
}

/** How long a new pick or place waits for its gripper, in seconds. */
export const GRIP_SECONDS = 0.5;

/** What a gripper does where the arm stands: `on` picks, and off places. `output`: its output, such as `Y010`. */
export interface Grip {
  output: string;
  on: boolean;
}

/**
 * The steps of a new move to a point, which becomes the step `at`, from 0. With a grip they are followed by its output, a
 * wait, and the move back to where the arm came from, if the steps tell that.
 */
export function stepsTo(document: Document, point: Point, at: number, grip: Grip | null): Step[] {
  const move = moveTo(document, point);
  if (grip === null) return [move];
  const back = standsAt(document, at - 1);
  return [
    move,
    newStep(move.table, [{ key: "do", value: "output" }, { key: "point", value: grip.output }, { key: "on", value: grip.on }]),
    newStep(move.table, [{ key: "do", value: "wait" }, { key: "seconds", value: GRIP_SECONDS }]),
    ...(back === null ? [] : [moveTo(document, back)]),
  ];
}

/** A new point, and steps that begin with `at`, from 0: one change. */
export function putPointAndSteps(document: Document, point: Point, at: number, steps: readonly Step[]): Command {
  return { kind: "all", commands: [putPoint(document, null, point), { kind: "insert", at, steps }] };
}
