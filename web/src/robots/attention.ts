/** Which robots need a person, and why. */
import type { RobotAlarm } from "../api/types.ts";
import { type View, isRunning, isSeen } from "./view.ts";

export type Entry = {
  /** Stays the same for as long as the cause stays: lists are keyed by it. */
  key: string;
  priority: 1 | 2;
  robots: string[];
  /** Since when, in milliseconds of the gateway's clock; `null` if that is not known. */
  since: number | null;
} & Cause;

export type Cause =
  | { kind: "alarm"; code: number; text: string | null; acknowledged: string | null }
  | { kind: "other_robot" }
  | { kind: "no_link" }
  /** `by`: who made it. */
  | { kind: "stop_holds"; by: string | null }
  /** A stop holds, and the values say that the robot runs or moves: a stop of the gateway holds no pendant. */
  | { kind: "runs_although_stopped" };

/** From so many robots on, lost links are one line. */
const FLOOD = 4;

/**
 * The list, by priority, then by waiting time. `time` turns the page's clock into the gateway's. Shelved
 * alarms are left out and counted, and so are robots in no entry of which it is not known whether they need a
 * person.
 */
export function attention(
  views: View[],
  alarms: RobotAlarm[],
  time: (pageMillis: number) => number,
): { entries: Entry[]; shelved: number; unknown: number } {
  const entries: Entry[] = [];
  const lost: View[] = [];
  let shelved = 0;
  for (const view of views) {
    const { name, summary, alarm } = view;
    if (summary.identity_changed !== null) {
      entries.push({ key: `${name} other`, priority: 1, robots: [name], since: null, kind: "other_robot" });
    }
    if (alarm !== null && alarm !== 0) {
      const known = alarms.find((one) => one.robot === name && one.code === alarm && one.state !== "ended");
      if (known?.shelved) {
        shelved += 1;
      } else {
        entries.push({
          key: `${name} alarm ${alarm}`,
          priority: known?.acknowledged ? 2 : 1,
          robots: [name],
          since: known === undefined ? null : Date.parse(known.since),
          kind: "alarm",
          code: alarm,
          text: known?.text ?? null,
          acknowledged: known?.acknowledged?.by ?? null,
        });
      }
    }
    if (summary.link === "down") lost.push(view);
    else if (summary.stopped) {
      const runs = isSeen(view) && (isRunning(view) || view.moving === true);
      if (runs) {
        const key = `${name} runs`;
        entries.push({ key, priority: 1, robots: [name], since: null, kind: "runs_although_stopped" });
      } else {
        const { stopped_by: made } = summary;
        const since = made === null ? null : Date.parse(made.at);
        entries.push({ key: `${name} stop`, priority: 2, robots: [name], since, kind: "stop_holds", by: made?.by ?? null });
      }
    }
  }
  const since = (view: View): number | null => (view.downSince === null ? null : time(view.downSince));
  if (lost.length >= FLOOD) {
    const first = lost.map(since).filter((one) => one !== null);
    const at = first.length > 0 ? Math.min(...first) : null;
    const robots = lost.map((view) => view.name);
    entries.push({ key: "links", priority: 2, robots, since: at, kind: "no_link" });
  } else {
    for (const view of lost) {
      const key = `${view.name} link`;
      entries.push({ key, priority: 2, robots: [view.name], since: since(view), kind: "no_link" });
    }
  }
  entries.sort((a, b) => a.priority - b.priority || (a.since ?? Infinity) - (b.since ?? Infinity));
  const told = new Set(entries.flatMap((entry) => entry.robots));
  const unknown = views.filter((view) => !told.has(view.name) && (!isSeen(view) || view.alarm === null)).length;
  return { entries, shelved, unknown };
}

/**
 * The list while somebody points at it: what is shown keeps its place, what is over goes, and what is new is
 * counted and waits.
 */
export function frozen(shown: string[], entries: Entry[]): { entries: Entry[]; waiting: number } {
  const now = new Map(entries.map((entry) => [entry.key, entry]));
  const kept = shown.map((key) => now.get(key)).filter((entry) => entry !== undefined);
  return { entries: kept, waiting: entries.length - kept.length };
}
