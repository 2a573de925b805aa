/** The words of runs of programs: on the page of a robot, and on the page that teaches it. */
import type { Run } from "../../api/types.ts";
import type { NotSent, Void } from "../../run/guard.ts";
import { count, seconds } from "./say.ts";
import { UNMET } from "./unmet.ts";

/** Why a run ended. */
export const RUN_ENDS: Record<NonNullable<Run["because"]>, string> = {
  finished: "it came to its end",
  lease_expired: "the control was not renewed",
  lease_released: "the control was given back",
  lease_taken: "an admin took the control",
  stop: "it was stopped or paused",
  identity_changed: "another robot answers",
  link_lost: "the link to the robot was lost",
  robot_changed: "the robot was changed or removed at the gateway",
  gateway_ended: "the gateway ended",
  owner_changed: "another gateway has the robot, or the database did not answer",
  gateway_killed: "the gateway was killed",
  not_ready: "the robot was not ready",
  refused: "the controller refused it",
  outcome_unknown: "a part of it was sent, and no usable answer came",
  alarm: "an alarm",
  mode_changed: "the mode changed",
  restarted: "the controller was started again",
  stalled: "nothing went on",
  not_at_target: "the arm stands somewhere else than at the last target",
  not_proved: "it is not proved that it was carried out",
  another_list: "another program is in the list",
  not_sent: "it could not be sent",
};

export const run = {
  title: (robot: string) => `Run on ${robot}`,
  prepare: (robot: string) => `Prepare run on ${robot}…`,
  takeAndPrepare: (robot: string) => `Take control and prepare run on ${robot}…`,
  next: (robot: string) => `Run it on ${robot}: take control and prepare…`,
  hold: (robot: string) => `Hold to run on ${robot}`,
  ask: (robot: string) => `Run on ${robot}?`,
  isTwin: "The twin: no real arm moves.",
  isVirtual: "Virtual: no real arm moves.",
  isReal: "The real arm.",
  isUnknown: "It may be a real arm: treat it as one.",
  what: (program: string, from: number, to: number, total: number) =>
    from === 1 && to === total
      ? `${program}: all ${count(total, "step", "steps")}.`
      : `${program}: step${from === to ? ` ${from}` : `s ${from} to ${to}`} of ${total}. Outputs, workbench and path speed of the steps before are not set.`,
  /** `set`: who set this speed; `null` if nobody did. */
  path: (mm: string, ms: number, speed: number, set: { by: string; at: string } | null) =>
    `${mm} in ${seconds(ms)} at ${speed} %${set === null ? "" : `, set by ${set.by}, ${set.at}, not read back`}.`,
  speedSet: (percent: number, by: string, at: string) =>
    `${percent} % set by ${by}, ${at}: the controller does not tell whether that still holds.`,
  /** `speed`: what the plan is made for. */
  speedUnknown: (speed: number) =>
    `The set speed is not known: it may be ${speed < 100 ? "faster or slower" : "slower"}.`,
  speedOfPanel: (percent: number) => `Its panel shows ${percent} %.`,
  list: "Its list is empty.",
  listUnknown: "Its firmware does not tell whether its list is empty: the gateway asks before it sends.",
  noPath: "The model of the arm is not set: expect any path, at full speed.",
  drawn: "The path is drawn in the picture of the arm.",
  kept: (program: string, version: number, steps: number, repeat: number) =>
    `${program}, version ${version}: ${count(steps, "step", "steps")}, ${count(repeat, "time", "times")}.`,
  notPrepared: (message: string) => `Not prepared: ${message}`,
  preparing: "Checking and planning…",
  taken: "It was sent to run. The next run is previewed anew, from where the arm stands then.",
  nameless: "a program that is not stored",
  by: (program: string, by: string, done: number, steps: number) => `${program}, run by ${by}. Steps seen to be done: ${done} of ${steps}.`,
  frames: "It runs with the tool and the work frame that are in use.",
  waits: (steps: number[]) =>
    `${steps.length === 1 ? "Step" : "Steps"} ${steps.join(", ")}: the arm waits for a signal there, and goes on when it comes.`,
  stay: "Stay here: the arm stops if this page is left, hidden for 30 s, or not used for 5 min.",
  noFrames: "Not prepared: tool and work frame cannot be read. Try again.",
  person: "Look: nobody may be near it.",
  notRun: (why: string) => `Not run: ${why}. Prepare it again.`,
  notRead: "the stored program, or tool and work frame, cannot be read again",
  replaced: "the program is another one now",
  void: (why: Void): string =>
    ({
      gateway: "the gateway is not heard",
      text: "the program is another one now",
      version: "another version of the program was stored",
      robot: "it is of another robot, or another one may answer now",
      model: "the model of the arm is another one now",
      speed: "the global speed may be another one now",
      arm: "the arm does not stand where the preview begins",
      arm_unknown: "where the arm stands is not known now",
      frames: "tool or work frame changed, or cannot be read",
      frames_in_use: "a tool or work frame is in use, and the preview is made without",
      lease: "the control has ended",
      stop: "a stop was made",
      stale: "the state of the robot is old",
      program: "the program of the controller is another one now, or is not known any more",
      list: "what is left in its list has changed, or is not known any more",
    })[why],
  looking: "Looking at tool and work frame…",
  to: (reason: NotSent) =>
    ({
      ...UNMET,
      alarm: "clear the alarm first, on the page of the robot",
      stop_holds: "clear the stop first, on the page of the robot",
      no_target: "this robot is not there",
      no_twin: "there is no twin here: preview only",
      twin_first: "run it on the twin first",
      no_program: "choose a program",
      no_steps: "there is no step to run",
      unread_field: "a field has a text that is no value",
      checking: "it is not checked yet",
      mistakes: "correct the mistakes first",
      too_many_axes: "the program moves axes that this robot does not have",
      taught: "a taught program runs on a controller only: load it there",
      repeats: "it repeats without an end (repeat = true)",
      appends: "it appends to what is left in the list (append = true)",
      no_preview: "preview it first",
      void: "the preview is void",
      plan_fails: "the preview does not run to its end without a problem",
      not_homed: "the robot is not homed",
      not_started: "the program of the controller does not run: start it on the page of the robot",
      moves: "the arm moves. If its own program works: stop the robot, choose the program that waits for instructions at its pendant, and start that",
      moves_unknown: "whether the arm moves is not known",
      list: "instructions are left in its list",
      list_unknown: "what is left in its list is not known",
      run_under_way: "a program runs on it",
      look_first: "what became of the last program is not known: look at the arm, and say so below",
    })[reason],
  startAbove: "the program of the controller does not run: prepare its start above",
  sent: (robot: string) => `Sent to ${robot}. No answer yet.`,
  accepted: (robot: string, accepted: number, done: number, steps: number) =>
    `Accepted by ${robot}: ${accepted} of ${steps} steps. Seen done: ${done}.`,
  unheard: (robot: string, done: number, steps: number) =>
    `The gateway is not heard. Last seen on ${robot}: ${done} of ${steps} steps done. Without this page the gateway stops the arm.`,
  unknown: (robot: string) =>
    `OUTCOME UNKNOWN. ${robot} may have carried it out, a part of it, or nothing. Look at the arm, and stop it if in doubt. It is not sent again.`,
  refused: (message: string) => `Refused, nothing was sent: ${message}`,
  listRefused: (message: string) => `The controller refused the list: ${message}`,
  mayCease: (program: string | null) =>
    `If its program${program === null ? "" : ` ${program}`} does not wait for instructions, this run is refused and the gateway stops the machine: it produces nothing until somebody starts that program again.`,
  ceased: (program: string | null) =>
    `Before this run ${program === null ? "the program of the controller" : `the program ${program} of the controller`} ran. It does not run now: start it again, if it is to produce.`,
  done: (robot: string, proof: string) => `Done on ${robot}, seen: ${proof}.`,
  proof: { reached: "the arm stands where the last move ends", consumed: "the list was worked through, and the arm stands", cut_short: "an input cut the last move short, and the arm stands", at_rest: "the list is empty, and the arm stands; whether outputs were set is not read back" } as Record<string, string>,
  stopped: (why: string) => `Stopped before its end: ${why}. It is proved that the arm stands.`,
  stoppedBy: (who: string, at: string) => `Stopped before its end by ${who}, ${at}. It is proved that the arm stands.`,
  failed: (why: string) => `Failed: ${why}. It is proved that the arm stands.`,
  notCarried: (why: string) => `Nothing was carried out: ${why}.`,
  unknownEnd: (why: string) => `OUTCOME UNKNOWN: ${why}. It is not known what was carried out, or not proved that the arm stands. Look at the arm.`,
  because: (why: Run["because"]) => (why === null ? "for no reason that was told" : RUN_ENDS[why]),
  look: (robot: string) => `Look at ${robot}`,
  tried: "It ran on the twin to its end. Now it can run on the arm.",
  seen: "I have looked at the arm",
};
