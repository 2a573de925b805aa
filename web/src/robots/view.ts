/** One robot as the tiles and the sentences show it. */
import type { RobotSummary, SignalQuality } from "../api/types.ts";
import { SELDOM } from "../live/age.ts";
import { type Robot, type Value, periodOf } from "../live/store.ts";

export interface View {
  name: string;
  summary: RobotSummary;
  /** How much the mode can be trusted: the tile is as good as that. */
  quality: SignalQuality;
  mode: number | null;
  /** The code of the last alarm that was read; 0 for none; `null` if it is not known whether there is an alarm. */
  alarm: number | null;
  /** This and what follows is `null` if it is not known now: nothing old is taken for it. */
  moving: boolean | null;
  homed: boolean | null;
  /** Instructions left in the list. */
  left: number | null;
  program: string | null;
  /** What the first counter counts. */
  parts: number | null;
  /** When the link was lost, on the page's clock; `null` if it is up or that is not known. */
  downSince: number | null;
  /** Another number for each time from which on another machine may answer behind the name. */
  who: number;
}

export function viewOf(robot: Robot): View {
  const value = (address: string): Value | undefined => robot.values.get(address);
  const isUp = robot.summary.link === "up";
  /** A value of now: fresh, and not read so seldom that it may be old all the same. */
  const fresh = (address: string): Value["value"] => {
    const read = value(address);
    return isUp && read?.quality === "fresh" && periodOf(robot, address) <= SELDOM ? read.value : null;
  };
  const number = (read: Value["value"] | undefined): number | null => (typeof read === "number" ? read : null);
  const flag = (read: Value["value"]): boolean | null => (typeof read === "boolean" ? read : null);
  const program = fresh("curMold");
  const alarm = number(value("curAlarm")?.value);
  return {
    name: robot.summary.name,
    // A robot without a link may start again meanwhile, and then has another speed.
    summary: isUp ? robot.summary : { ...robot.summary, global_speed: null },
    quality: robot.summary.link === "down" ? "stale" : (value("curMode")?.quality ?? "none"),
    mode: number(value("curMode")?.value),
    // An old alarm is shown with its age. That there was none once says nothing of now.
    alarm: alarm === 0 ? number(fresh("curAlarm")) : alarm,
    moving: flag(fresh("isMoving")),
    homed: flag(fresh("origin")),
    left: number(fresh("RemoteCmdLen")),
    program: typeof program === "string" && program !== "" ? program : null,
    parts: isUp ? partsOf(robot) : null,
    downSince: robot.downSince,
    who: robot.ticket,
  };
}

/** The gateway takes the first counter that it reads for the parts, unless its file names another one. */
function partsOf(robot: Robot): number | null {
  for (const [address, { value, quality }] of robot.values) {
    if (!address.startsWith("counter-")) continue;
    if (quality !== "fresh") return null;
    if (typeof value === "object" && value !== null && "current" in value) return value.current;
    return null;
  }
  return null;
}

/** The numbers of `curMode` that the manual has. */
export const MODES = { none: 0, manual: 1, rest: 2, stopped: 3, running: 7, step: 8, cycle: 9 } as const;

/** Whether a program runs: it may wait for something. */
export function isRunning(view: View): boolean {
  return view.mode === MODES.running || view.mode === MODES.cycle;
}

/** Whether the mode of the robot is the one of now. What else is known of it is `null` if it may be old. */
export function isSeen(view: View): boolean {
  return view.summary.link === "up" && view.quality === "fresh";
}

/** Whether the arm may move now: also if that is not known. */
export function mayMove(view: View): boolean {
  return !isSeen(view) || view.moving !== false || isRunning(view);
}

/** Real arms and those of which that is not known first, then virtual robots, then twins; else in the order that they had. */
export function inOrder(views: View[]): View[] {
  const rank = ({ summary }: View): number => (summary.twin_of !== null ? 2 : summary.virtual === true ? 1 : 0);
  return [...views].sort((a, b) => rank(a) - rank(b));
}
