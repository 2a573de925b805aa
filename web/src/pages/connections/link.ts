/** Which is at fault: robot, network or gateway. It says no more than the links tell. */
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
  /** It did not change since the begin of what was asked for, as far as the gateway saw. */
  | { kind: "before"; at: number }
  | { kind: "unknown" };

/** `events` are those of the links in a span that begins at `from`, in the order of time. */
export function sinceOf(events: readonly HistoryEvent[], from: number, isUp: boolean): Since {
  const last = events.at(-1);
  if (last === undefined) return { kind: "before", at: from };
  const fits = last.event === (isUp ? "link_back" : "link_lost");
  return fits ? { kind: "at", at: Date.parse(last.time) } : { kind: "unknown" };
}

/** How often the link was lost in these events. */
export function lossesIn(events: readonly HistoryEvent[]): number {
  return events.filter(({ event }) => event === "link_lost").length;
}
