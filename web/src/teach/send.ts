/** What keeps a program from being sent, and what is known after it was sent. */
import type { ProgramChecked, ProgramPlan, Run } from "../api/types.ts";
import type { Answer } from "../api/client.ts";
import { type Unmet, unmet } from "../robots/sentence.ts";
import { MODES, type View } from "../robots/view.ts";
import type { Void } from "./preview.ts";

export type NotSent =
  | Exclude<Unmet, "running" | "no_alarm" | "no_stop" | "not_running" | "no_program" | "list_left">
  | "no_target"
  | "no_twin"
  | "twin_first"
  | "no_steps"
  | "unread_field"
  | "checking"
  | "mistakes"
  | "taught"
  | "repeats"
  | "appends"
  | "no_preview"
  | "void"
  | "plan_fails"
  | "not_homed"
  | "not_started"
  | "moves"
  | "moves_unknown"
  | "list"
  | "list_unknown"
  | "run_under_way"
  | "look_first";

/** Which steps are to run, counted from 0. */
export type Scope = { kind: "all" } | { kind: "from"; step: number } | { kind: "one"; step: number };

/** The first step, and the one behind the last. */
export function range(scope: Scope, steps: number): [number, number] {
  if (scope.kind === "all") return [0, steps];
  const begin = Math.min(scope.step, steps);
  return scope.kind === "from" ? [begin, steps] : [begin, Math.min(begin + 1, steps)];
}

export interface Ready {
  gateway: boolean;
  right: boolean;
  lease: boolean;
  /** Whether there is a way to try programs first: a twin, or the robot is a virtual one. */
  hasTwin: boolean;
  /** Whether the program ran on the twin to its end, if it has to. */
  tried: boolean;
  steps: number;
  /** Whether a field of a step has a text that is not taken into the program. */
  unread: boolean;
  /** What the check of the present text says; `null` until it is there. */
  checked: Pick<ProgramChecked, "ok" | "kind"> | null;
  repeats: boolean;
  appends: boolean;
  plan: Pick<ProgramPlan, "ended" | "problems"> | null;
  /** Why the preview does not hold. */
  isVoid: Void | null;
  runs: boolean;
  /** Whether it is not known what became of the last program, and somebody has to look first. */
  isUnknown: boolean;
}

/**
 * What keeps the program from being sent, what to mend first stands first. The gateway checks all this again.
 */
export function notSent(view: View | undefined, ready: Ready): NotSent[] {
  if (view === undefined) return ["no_target"];
  // What else is in the way then is its own doing.
  if (ready.runs) return ["run_under_way"];
  if (ready.isUnknown) return ["look_first"];
  const reasons: NotSent[] = [];
  const check = (isMet: boolean, reason: NotSent): void => {
    if (!isMet) reasons.push(reason);
  };
  // A start has the same conditions, but for the program of the controller, which has to run here.
  for (const reason of unmet("start", view, ready)) if (reason !== "running") reasons.push(reason as NotSent);
  check(ready.hasTwin, "no_twin");
  check(ready.steps > 0, "no_steps");
  check(!ready.unread, "unread_field");
  if (ready.steps > 0) {
    check(ready.checked !== null, "checking");
    check(ready.checked?.ok !== false, "mistakes");
    check(ready.checked?.kind !== "taught", "taught");
    check(!ready.repeats, "repeats");
    check(!ready.appends, "appends");
    if (ready.checked?.ok === true && ready.checked.kind !== "taught") {
      check(ready.plan !== null, "no_preview");
      check(ready.plan === null || ready.isVoid === null, "void");
      check(ready.plan === null || (ready.plan.ended === "done" && ready.plan.problems.length === 0), "plan_fails");
      check(ready.tried || !ready.hasTwin, "twin_first");
    }
  }
  if (view.quality === "fresh" && view.summary.link === "up") {
    const { mode } = view;
    check(mode === MODES.running || mode === MODES.manual || mode === MODES.step, "not_started");
    check(view.homed !== false, "not_homed");
    check(view.moving !== true, "moves");
    check(view.moving !== null, "moves_unknown");
    check(view.left !== null, "list_unknown");
    check(view.left === null || view.left === 0, "list");
  }
  return reasons;
}

/** What is known of a run. `sent`: no answer yet. `unknown`: whether it was carried out is not known. */
export type Sent =
  | { kind: "sent" }
  | { kind: "accepted"; run: Run }
  /** The gateway is not heard, or its answer of the run is old. */
  | { kind: "unheard"; run: Run }
  | { kind: "ended"; run: Run }
  | { kind: "refused"; message: string }
  | { kind: "unknown" };

/** What an answer to the request tells. */
export function sentBy(answer: Answer<Run>): Sent {
  if (answer.kind === "ok") return ofRun(answer.value);
  if (answer.kind === "unknown" || answer.status >= 500) {
    // A gateway that is busy, or whose disk fails, sent nothing: its code says so.
    const isCertain = answer.kind === "refused" && (answer.problem.code === "overloaded" || answer.problem.code === "store_unavailable");
    if (!isCertain) return { kind: "unknown" };
  }
  return { kind: "refused", message: answer.kind === "refused" ? `${answer.problem.message} (${answer.problem.code})` : "" };
}

export function ofRun(run: Run): Sent {
  return run.state === "running" ? { kind: "accepted", run } : { kind: "ended", run };
}

/** Whether it is not known what became of it. */
export function isOpen(sent: Sent | null): boolean {
  return sent?.kind === "unknown" || (sent?.kind === "ended" && sent.run.state === "unknown");
}

/** Whether the run may still be under way. */
export function mayRun(sent: Sent | null): boolean {
  return sent !== null && (sent.kind === "sent" || sent.kind === "accepted" || sent.kind === "unheard");
}
