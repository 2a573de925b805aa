/** What a robot does and waits for, as a typed value. The words are in i18n/. */
import type { RobotAlarm } from "../api/types.ts";
import { MODES, type View, isRunning, isSeen } from "./view.ts";

export type Doing =
  | { kind: "no_link" }
  | { kind: "other_robot"; found: string | null }
  | { kind: "not_read" }
  | { kind: "alarm"; code: number; text: string | null }
  /**
   * `stands`: whether it is seen that the arm stands; if not, it is not known. `mine`: whether the person at
   * this page holds the lease.
   */
  | { kind: "stop_holds"; stands: boolean; mine: boolean }
  | { kind: "manual" }
  | { kind: "moves"; program: string | null; left: number | null }
  | { kind: "runs"; program: string | null; left: number | null; stands: boolean }
  | { kind: "waits_for_start"; stands: boolean }
  | { kind: "stopped"; stands: boolean }
  | { kind: "unknown_mode"; mode: number };

/**
 * The first of these that holds: what has to be mended first stands first. `mine`: whether the person at this
 * page holds the lease. `isNow`: whether what the page knows is of now.
 */
export function doing(view: View, alarms: RobotAlarm[], mine = false, isNow = true): Doing {
  const { summary, mode, alarm, moving, program, left } = view;
  if (summary.link === "down") return { kind: "no_link" };
  if (summary.identity_changed !== null) {
    return { kind: "other_robot", found: summary.identity_changed.found.machine_name };
  }
  if (view.quality === "none" || mode === null) return { kind: "not_read" };
  if (alarm !== null && alarm !== 0) {
    const known = alarms.find((one) => one.code === alarm && one.state !== "ended");
    return { kind: "alarm", code: alarm, text: known?.text ?? null };
  }
  if (moving === true) return { kind: "moves", program, left };
  const stands = isNow && moving === false && isSeen(view);
  if (isRunning(view)) return { kind: "runs", program, left, stands };
  if (summary.stopped) return { kind: "stop_holds", stands, mine };
  if (mode === MODES.manual || mode === MODES.step) return { kind: "manual" };
  if (mode === MODES.rest) return { kind: "waits_for_start", stands };
  if (mode === MODES.stopped) return { kind: "stopped", stands };
  return { kind: "unknown_mode", mode };
}

/** Why a control cannot be used now. */
export type Unmet =
  | "gateway_lost"
  | "no_right"
  | "no_link"
  | "other_robot"
  | "no_lease"
  | "stale"
  /** The gateway waits for an answer of the robot. */
  | "unanswered"
  | "manual"
  /** The mode is “stop”: a person turns the key. */
  | "mode_stop"
  | "alarm"
  | "no_alarm"
  | "stop_holds"
  | "no_stop"
  | "running"
  | "not_running";

/**
 * `change`: what sets a number and moves nothing. `may_move`: outputs and registers, which a cell may start
 * its motion by.
 */
export type Control = "start" | "pause" | "clear_alarm" | "clear_stop" | "change" | "may_move";

/** What keeps a control from being used, the first to mend first. The gateway checks all this again. */
export function unmet(
  control: Control,
  view: View,
  has: { gateway: boolean; right: boolean; lease: boolean },
): Unmet[] {
  const reasons: Unmet[] = [];
  const check = (isMet: boolean, reason: Unmet): void => {
    if (!isMet) reasons.push(reason);
  };
  check(has.gateway, "gateway_lost");
  check(has.right, "no_right");
  // Of a gateway that is not heard, links and robots of now are not known.
  check(!has.gateway || view.summary.link === "up", "no_link");
  check(!has.gateway || view.summary.identity_changed === null, "other_robot");
  // A pause needs no lease, as a stop.
  if (control !== "pause") check(has.lease, "no_lease");
  if (reasons.length > 0) return reasons;
  const isAlarmed = view.alarm !== null && view.alarm !== 0;
  const isManual = view.mode === MODES.manual || view.mode === MODES.step;
  switch (control) {
    case "start":
      check(view.quality === "fresh", "stale");
      check(!view.summary.stopped, "stop_holds");
      check(!isAlarmed, "alarm");
      check(!isManual, "manual");
      check(view.mode !== MODES.stopped, "mode_stop");
      check(!isRunning(view), "running");
      break;
    case "pause":
      check(isRunning(view) || view.moving !== false, "not_running");
      break;
    case "clear_alarm":
      check(isAlarmed, "no_alarm");
      check(!isManual, "manual");
      break;
    case "clear_stop":
      check(view.summary.stopped, "no_stop");
      break;
    case "may_move":
      check(!view.summary.stopped, "stop_holds");
      check(!isManual, "manual");
      break;
    case "change":
      check(!isManual, "manual");
      break;
  }
  return reasons;
}
