/** Where a text has to run before it may run on a robot of the page that teaches: rules of that page, pure. */
import type { RobotSummary } from "../api/types.ts";
import type { Ready } from "./guard.ts";

export interface Trial {
  /** Whether the program may be run on this robot at all: a real arm has to have a twin. */
  hasTwin: boolean;
  /** Whether the text may run here without a trial elsewhere: on the twin itself, or on a virtual robot without one. */
  needsNoTrial: boolean;
  /** Whether nothing has to run before: it is the first one, or the twin ran this text to its end. */
  tried: boolean;
}

/** `hasRun`: whether a twin of this name, of the same model, ran this text to its end in this page. */
export function trialOf(
  { virtual, twin, twin_of }: Pick<RobotSummary, "virtual" | "twin" | "twin_of">,
  hasRun: (twin: string) => boolean,
): Trial {
  // Of a robot of which that is not known a twin is asked for, as of an arm.
  const isArm = virtual !== true;
  // A twin that is there is tried first, whatever the arm is.
  const needsNoTrial = twin_of !== null || (twin === null && !isArm);
  return { hasTwin: twin !== null || twin_of !== null || !isArm, needsNoTrial, tried: needsNoTrial || (twin !== null && hasRun(twin)) };
}

/** What this page may do, and whether somebody controls the robot, as the gateway says. */
export type Access = Pick<Ready, "gateway" | "right" | "lease"> & { isHeld: boolean };

/** Whether nobody controls the robot, and this page may: then preparing a run takes control first, and says so. */
export function isFreeToTake({ gateway, right, lease, isHeld }: Access): boolean {
  return gateway && right && !lease && !isHeld;
}
