/** One robot as the tiles and the sentences show it. */
import type { RobotSummary, SignalQuality } from "../api/types.ts";
import type { Robot, Value } from "../live/store.ts";

export interface View {
  name: string;
  summary: RobotSummary;
  /** How much the mode can be trusted: the tile is as good as that. */
  quality: SignalQuality;
  mode: number | null;
  /** The code of the alarm; 0 for none. */
  alarm: number | null;
  moving: boolean | null;
  homed: boolean | null;
  /** Instructions left in the list. */
  left: number | null;
  program: string | null;
  /** What the first counter counts. */
  parts: number | null;
  /** When the link was lost, on the page's clock; `null` if it is up or that is not known. */
  downSince: number | null;
}

export function viewOf(robot: Robot): View {
  const value = (address: string): Value | undefined => robot.values.get(address);
  const number = (address: string): number | null => {
    const read = value(address)?.value;
    return typeof read === "number" ? read : null;
  };
  const flag = (address: string): boolean | null => {
    const read = value(address)?.value;
    return typeof read === "boolean" ? read : null;
  };
  const program = value("curMold")?.value;
  return {
    name: robot.summary.name,
    summary: robot.summary,
    quality: robot.summary.link === "down" ? "stale" : (value("curMode")?.quality ?? "none"),
    mode: number("curMode"),
    alarm: number("curAlarm"),
    moving: flag("isMoving"),
    homed: flag("origin"),
    left: number("RemoteCmdLen"),
    program: typeof program === "string" && program !== "" ? program : null,
    parts: partsOf(robot),
    downSince: robot.downSince,
  };
}

/** The gateway takes the first counter that it reads for the parts, unless its file names another one. */
function partsOf(robot: Robot): number | null {
  for (const [address, { value }] of robot.values) {
    if (!address.startsWith("counter-")) continue;
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

/** Whether values of the robot can be relied on now. */
export function isSeen(view: View): boolean {
  return view.summary.link === "up" && view.quality === "fresh";
}

/** Whether the arm may move now: also if that is not known. */
export function mayMove(view: View): boolean {
  return !isSeen(view) || view.moving !== false || isRunning(view);
}
