/**
 * The guard of runs: what must hold before a program may be sent (`NEEDS`), and what makes void what was planned
 * (`PLAN_VOIDS`) or what a person agreed to (`CONSENT_VOIDS`). Tables of rules, pure. The gateway checks all this again.
 */
import type { ProgramChecked, ProgramPlan } from "../api/types.ts";
import { type Consent, changed } from "../robots/consent.ts";
import { MODES, type View, isSeen } from "../robots/view.ts";

/** How far an axis may stand from where the plan begins, in degrees or mm: encoders tremble. */
export const TREMBLE = 0.05;

/** What a plan was made of, and the same as it is now. */
export interface Basis {
  /** Whether the gateway is heard: else nothing of this is of now. */
  isHeard: boolean;
  /** What would be sent: a text, or the name of a kept program with its rounds. */
  text: string;
  /**
   * The `ETag` of the latest version of the kept program that would run; `null` for a text. The number alone comes
   * again for a program that was removed and stored anew.
   */
  version: string | null;
  /** The robot that it is planned for, the machine behind its name, and its model. */
  robot: string;
  machine: string;
  model: string | null;
  /** The global speed that is assumed, in percent. */
  speed: number;
  /** The global speed that was set last, in percent; `null` if the gateway does not know it. */
  setSpeed: number | null;
  /** Where its axes stand; `null` if that is not known now. */
  axes: readonly number[] | null;
  /** Tool and work frame in use, as the robot tells them; `null` if it does not. */
  frames: string | null;
}

/** What a person agreed to besides the plan, and the same as it is now. */
export interface Agreed {
  /** The number of the lease of this page; `null` without one. */
  lease: number | null;
  /** Whether a stop holds, or is under way. */
  isStopped: boolean;
  /** Whether the state of the robot is one of now. */
  isFresh: boolean;
  view: View;
  consent: Consent;
}

export type PlanVoid =
  | "gateway"
  | "robot"
  | "model"
  | "text"
  | "version"
  | "speed"
  | "frames"
  | "frames_in_use"
  | "arm_unknown"
  | "arm";
export type ConsentVoid = "lease" | "stop" | "stale" | "robot" | "program" | "list";
export type Void = PlanVoid | ConsentVoid;

export interface VoidRule<Reason, Of> {
  reason: Reason;
  isBroken(made: Of, now: Of): boolean;
}

/** What makes a plan void. The first reason is told. */
export const PLAN_VOIDS: readonly VoidRule<PlanVoid, Basis>[] = [
  { reason: "gateway", isBroken: (_, now) => !now.isHeard },
  // Another machine of the same name is another robot.
  { reason: "robot", isBroken: (made, now) => now.robot !== made.robot || now.machine !== made.machine },
  { reason: "model", isBroken: (made, now) => now.model !== made.model },
  { reason: "text", isBroken: (made, now) => now.text !== made.text },
  { reason: "version", isBroken: (made, now) => now.version !== made.version },
  { reason: "speed", isBroken: (made, now) => now.speed !== made.speed || now.setSpeed !== made.setSpeed },
  { reason: "frames", isBroken: (made, now) => now.frames !== made.frames },
  { reason: "frames_in_use", isBroken: (made) => framesInUse(made.frames) },
  // What is not read, or old, has not stayed.
  { reason: "arm_unknown", isBroken: (made, now) => now.axes === null || made.axes === null },
  {
    reason: "arm",
    isBroken: (made, now) => now.axes !== null && made.axes !== null && !hasStayed(made.axes, now.axes),
  },
];

/** What makes void what a person agreed to, besides the plan. */
export const CONSENT_VOIDS: readonly VoidRule<ConsentVoid, Agreed>[] = [
  { reason: "lease", isBroken: (made, now) => now.lease === null || now.lease !== made.lease },
  { reason: "stop", isBroken: (_, now) => now.isStopped },
  { reason: "stale", isBroken: (_, now) => !now.isFresh },
  { reason: "robot", isBroken: (made, now) => changed(made.consent, now.view) === "robot" },
  { reason: "program", isBroken: (made, now) => changed(made.consent, now.view) === "program" },
  { reason: "list", isBroken: (made, now) => changed(made.consent, now.view) === "left" },
];

/** The first reason why something does not hold any more; `null` if it holds. */
export function voidBy<Reason, Of>(rules: readonly VoidRule<Reason, Of>[], made: Of, now: Of): Reason | null {
  return rules.find((rule) => rule.isBroken(made, now))?.reason ?? null;
}

/** Whether the axes stand where they stood. */
function hasStayed(before: readonly number[], now: readonly number[]): boolean {
  return before.every((value, at) => Math.abs(value - (now[at] ?? Infinity)) <= TREMBLE);
}

/**
 * Whether a tool or a work frame is in use: a plan is made without, and linear moves go elsewhere with them.
 */
export function framesInUse(frames: string | null): boolean {
  if (frames === null) return false;
  const read: unknown = JSON.parse(frames);
  return !Array.isArray(read) || read.slice(0, 2).some((number) => Number(number) !== 0);
}

/** Commands that make a plan void, as events tell them: `modifyGSPD "300"`. */
export function voidByCommand(command: string): PlanVoid | null {
  if (/^modify(?:GSPD|AccDec)\b/.test(command)) return "speed";
  if (/^(?:switchTool|modifyTool|switchCoordinate|modifyCoordinate)\b/.test(command)) return "frames";
  return null;
}

/** Why a program may not be sent. */
export type NotSent =
  | "no_target"
  | "run_under_way"
  | "look_first"
  | "gateway_lost"
  | "no_right"
  | "no_link"
  | "other_robot"
  | "no_lease"
  | "stale"
  | "stop_holds"
  | "alarm"
  | "manual"
  | "no_twin"
  | "no_program"
  | "no_steps"
  | "unread_field"
  | "checking"
  | "mistakes"
  | "too_many_axes"
  | "taught"
  | "repeats"
  | "appends"
  | "no_preview"
  | "void"
  | "plan_fails"
  | "twin_first"
  | "not_started"
  | "not_homed"
  | "moves"
  | "moves_unknown"
  | "list"
  | "list_unknown";

export interface Ready {
  view: View;
  gateway: boolean;
  right: boolean;
  lease: boolean;
  /** Whether the program may run on this robot at all: after a twin, or because the robot is a virtual one. */
  hasTwin: boolean;
  /** Whether the program ran on the twin to its end, if it has to. */
  tried: boolean;
  /** Whether a program is chosen. */
  isChosen: boolean;
  steps: number;
  /** Whether a field of a step has a text that is not taken into the program. */
  unread: boolean;
  /** What the check of the present text says; `null` until it is there. */
  checked: Pick<ProgramChecked, "ok" | "kind"> | null;
  /** Whether a step moves an axis that the robot does not have. */
  isBeyondAxes: boolean;
  repeats: boolean;
  appends: boolean;
  /** Whether there is a plan that was not run yet; a robot without a model has one without a path. */
  isPlanned: boolean;
  /** The path of the plan; `null` without a plan, and without a model. */
  plan: Pick<ProgramPlan, "ended" | "problems"> | null;
  /** Why the plan does not hold. */
  isVoid: PlanVoid | null;
  /** What the controller tells at all: not each firmware tells whether the arm moves and what is left in the list. */
  tells: { moving: boolean; list: boolean };
  runs: boolean;
  /** Whether it is not known what became of the last program, and somebody has to look first. */
  isUnknown: boolean;
}

/**
 * When a rule is looked at. `alone`: what else is in the way then is its own doing. `access`: always. `state`: if the
 * access is there. `program`: always. `arm`: if the state of the robot is one of now.
 */
type Stage = "alone" | "access" | "state" | "program" | "arm";

export interface Need {
  reason: NotSent;
  stage: Stage;
  isMet(now: Ready): boolean;
}

/** Whether the program has steps that a list of the controller can take. */
const isProgram = ({ steps, checked }: Ready): boolean => steps > 0 && checked?.ok === true && checked.kind !== "taught";
const isManual = ({ view }: Ready): boolean => view.mode === MODES.manual || view.mode === MODES.step;

/** What must hold, what to mend first stands first. */
export const NEEDS: readonly Need[] = [
  { reason: "run_under_way", stage: "alone", isMet: (now) => !now.runs },
  { reason: "look_first", stage: "alone", isMet: (now) => !now.isUnknown },
  { reason: "gateway_lost", stage: "access", isMet: (now) => now.gateway },
  { reason: "no_right", stage: "access", isMet: (now) => now.right },
  { reason: "no_link", stage: "access", isMet: ({ gateway, view }) => !gateway || view.summary.link === "up" },
  { reason: "other_robot", stage: "access", isMet: ({ gateway, view }) => !gateway || view.summary.identity_changed === null },
  { reason: "no_lease", stage: "access", isMet: (now) => now.lease },
  { reason: "stale", stage: "state", isMet: ({ view }) => view.quality === "fresh" },
  { reason: "stop_holds", stage: "state", isMet: ({ view }) => !view.summary.stopped },
  { reason: "alarm", stage: "state", isMet: ({ view }) => view.alarm === null || view.alarm === 0 },
  { reason: "manual", stage: "state", isMet: (now) => !isManual(now) },
  { reason: "no_twin", stage: "program", isMet: (now) => now.hasTwin },
  { reason: "no_program", stage: "program", isMet: (now) => now.isChosen },
  { reason: "no_steps", stage: "program", isMet: (now) => !now.isChosen || now.steps > 0 },
  { reason: "unread_field", stage: "program", isMet: (now) => !now.unread },
  { reason: "checking", stage: "program", isMet: (now) => now.steps === 0 || now.checked !== null },
  { reason: "mistakes", stage: "program", isMet: (now) => now.steps === 0 || now.checked?.ok !== false },
  { reason: "too_many_axes", stage: "program", isMet: (now) => !now.isBeyondAxes },
  { reason: "taught", stage: "program", isMet: (now) => now.steps === 0 || now.checked?.kind !== "taught" },
  { reason: "repeats", stage: "program", isMet: (now) => !now.repeats },
  { reason: "appends", stage: "program", isMet: (now) => !now.appends },
  { reason: "no_preview", stage: "program", isMet: (now) => !isProgram(now) || now.isPlanned },
  { reason: "void", stage: "program", isMet: (now) => !isProgram(now) || !now.isPlanned || now.isVoid === null },
  {
    reason: "plan_fails",
    stage: "program",
    isMet: (now) => !isProgram(now) || now.plan === null || (now.plan.ended === "done" && now.plan.problems.length === 0),
  },
  { reason: "twin_first", stage: "program", isMet: (now) => !isProgram(now) || now.tried || !now.hasTwin },
  {
    reason: "not_started",
    stage: "arm",
    isMet: (now) => now.view.mode === MODES.running || isManual(now),
  },
  { reason: "not_homed", stage: "arm", isMet: ({ view }) => view.homed !== false },
  { reason: "moves", stage: "arm", isMet: ({ view }) => view.moving !== true },
  { reason: "moves_unknown", stage: "arm", isMet: ({ view, tells }) => view.moving !== null || !tells.moving },
  { reason: "list", stage: "arm", isMet: ({ view }) => view.left === null || view.left === 0 },
  { reason: "list_unknown", stage: "arm", isMet: ({ view, tells }) => view.left !== null || !tells.list },
];

/** What keeps a program from being sent, what to mend first stands first. */
export function notSent(now: Ready | null, needs: readonly Need[] = NEEDS): NotSent[] {
  if (now === null) return ["no_target"];
  const unmet = needs.filter((need) => !need.isMet(now));
  const of = (stage: Stage): Need[] => unmet.filter((need) => need.stage === stage);
  const [alone] = of("alone");
  if (alone !== undefined) return [alone.reason];
  const hasAccess = of("access").length === 0;
  const isNow = isSeen(now.view);
  return unmet
    .filter(({ stage }) => (stage !== "state" || hasAccess) && (stage !== "arm" || isNow))
    .map(({ reason }) => reason);
}
