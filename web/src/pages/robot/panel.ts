/**
 * What an action at the panel of a virtual robot needs. The gateway checks all this again: docs/GATEWAY.md.
 */
import type { Role } from "../../api/types.ts";
import { MODES } from "../../robots/view.ts";

/**
 * `stop`: buttons stop and pause, the emergency stop. `move`: the buttons that start. `by_hand`: moves by
 * hand. `move_nothing`: release, clear, another program. `input`: an input, for which a program may wait.
 * `set_up`: the key, alarms. `begin_fault`: also while the robot does not answer. `end_fault`: the end of a fault, also
 * while no lease can be had.
 */
export type PanelNeeds = "stop" | "move" | "by_hand" | "move_nothing" | "input" | "set_up" | "begin_fault" | "end_fault";

export type PanelUnmet =
  | "gateway_lost"
  | "no_right"
  | "needs_engineer"
  | "no_lease"
  | "unanswered"
  | "stop_holds"
  | "manual"
  | "not_manual";

export interface PanelHas {
  gateway: boolean;
  role: Role;
  lease: boolean;
  /**
   * Whether the robot answers the gateway, as far as that is seen. A panel is asked by another way: it may answer while
   * the robot does not, and the gateway refuses what needs an answer of the robot.
   */
  answers: boolean;
  stopped: boolean;
  /** `null` before it was read. */
  mode: number | null;
}

export function panelUnmet(needs: PanelNeeds, has: PanelHas): PanelUnmet[] {
  const found: PanelUnmet[] = [];
  const check = (isMet: boolean, reason: PanelUnmet): void => {
    if (!isMet) found.push(reason);
  };
  check(has.gateway, "gateway_lost");
  check(has.role !== "viewer", "no_right");
  if (needs === "stop" || found.length > 0) return found;
  const isSetUp = needs === "input" || needs === "set_up" || needs === "begin_fault" || needs === "end_fault";
  if (isSetUp) check(has.role !== "operator", "needs_engineer");
  if (needs === "end_fault") return found;
  check(has.lease, "no_lease");
  if (needs !== "begin_fault") check(has.answers, "unanswered");
  if (needs === "move" || needs === "by_hand" || needs === "input") check(!has.stopped, "stop_holds");
  if (needs === "by_hand") check(has.mode === MODES.manual, "not_manual");
  return found;
}

/** From this age on, in milliseconds, what a panel said is old. */
export const OLD = 3_000;

/** The global speeds that the panels of virtual robots said last: these controllers do not report it either. */
export class PanelSpeeds {
  private readonly said = new Map<string, { percent: number; at: number }>();

  /** `at`: when the panel was asked, on the page's clock. */
  say(robot: string, percent: number, at: number): void {
    this.said.set(robot, { percent, at });
  }

  /** The percent; `null` if no panel has said it, or not lately. */
  of(robot: string, now: number): number | null {
    const said = this.said.get(robot);
    return said !== undefined && now - said.at < OLD ? said.percent : null;
  }
}

export const panelSpeeds = new PanelSpeeds();
