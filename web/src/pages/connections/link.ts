/** Which is at fault: robot, network or gateway. It says no more than the links tell. */
import type { RobotIdentity } from "../../api/types.ts";
import type { HistoryEvent } from "./types.ts";

export type Fault =
  /** No robot is configured, or each one has a link. */
  | { kind: "none" }
  | { kind: "no_robot" }
  /** The gateway is not heard: of the robots nothing is known. */
  | { kind: "gateway" }
  /** Two or more robots, and none has a link. */
  | { kind: "all"; robots: string[] }
  | { kind: "some"; robots: string[] }
  /** The only robot has no link. */
  | { kind: "only"; robots: string[] };

export function faultOf(links: readonly { name: string; isUp: boolean }[], isHeard: boolean): Fault {
  if (!isHeard) return { kind: "gateway" };
  if (links.length === 0) return { kind: "no_robot" };
  const robots = links.filter(({ isUp }) => !isUp).map(({ name }) => name);
  if (robots.length === 0) return { kind: "none" };
  if (links.length === 1) return { kind: "only", robots };
  return { kind: robots.length === links.length ? "all" : "some", robots };
}

/** Since when the link is as it is. */
export type Since =
  | { kind: "at"; at: number }
  /** The gateway began to see it then: it may have been like this before. */
  | { kind: "at_least"; at: number }
  /** No change was seen in the span that was asked for. */
  | { kind: "no_change" }
  | { kind: "unknown" };

/** `events` are those of the links, and when the robot was not seen, in the order of time. */
export function sinceOf(events: readonly HistoryEvent[], isUp: boolean): Since {
  const last = events.findLast(({ event }) => event === "link_lost" || event === "link_back");
  const unseen = events.findLast((event) => event.event === "unseen");
  const until = unseen?.event === "unseen" ? Date.parse(unseen.to) : null;
  const at = last === undefined ? null : Date.parse(last.time);
  if (until !== null && (at === null || until > at)) return { kind: "at_least", at: until };
  if (last === undefined || at === null) return { kind: "no_change" };
  return last.event === (isUp ? "link_back" : "link_lost") ? { kind: "at", at } : { kind: "unknown" };
}

/** How often the link was lost in these events. */
export function lossesIn(events: readonly HistoryEvent[]): number {
  return events.filter(({ event }) => event === "link_lost").length;
}

/** What answers: its name and its firmware. */
export function machineOf(identity: RobotIdentity | null): string {
  return identity === null ? "-" : `${identity.machine_name ?? "?"}, ${identity.firmware ?? "?"}`;
}
