/** What happened in the minute before and after an alarm began, and around its end. Pure: times are milliseconds since 1970. */
import type { GatewayEvent, HistoryEvent, RobotAlarm } from "../api/types.ts";

/** How long before and after, in milliseconds. */
export const NEAR = 60_000;

export interface Span {
  from: number;
  to: number;
}

/** The spans of the time line, in order; they do not overlap. */
export function spansOf(alarm: Pick<RobotAlarm, "since" | "until">): Span[] {
  const around = (at: string): Span => ({ from: Date.parse(at) - NEAR, to: Date.parse(at) + NEAR });
  const begin = around(alarm.since);
  if (alarm.until === null) return [begin];
  const end = around(alarm.until);
  return end.from <= begin.to ? [{ from: begin.from, to: Math.max(begin.to, end.to) }] : [begin, end];
}

/** What people and programs did over the gateway. The history has the rest. */
const DEEDS = [
  "lease_began",
  "lease_ended",
  "stop_began",
  "stop_ended",
  "stop_cleared",
  "command_began",
  "run_began",
  "run_ended",
  "global_speed",
  "alarm_acknowledged",
  "alarm_shelved",
  "alarm_unshelved",
  "identity_changed",
  "identity_accepted",
  "robot_changed",
] as const;

export type Deed = Extract<GatewayEvent, { event: (typeof DEEDS)[number] }>;
export type CommandEnd = Extract<GatewayEvent, { event: "command_ended" }>["outcome"];

export type Row = { at: number; key: string } & (
  | { kind: "seen"; event: HistoryEvent; isItself: boolean }
  /** `outcome`: of a command; `null` if it is not known yet. */
  | { kind: "deed"; event: Deed; outcome: CommandEnd | null }
);

function isDeed(event: GatewayEvent): event is Deed {
  return (DEEDS as readonly string[]).includes(event.event);
}

/**
 * The rows of the time line, the earliest first. `history`: the events of the robot's history. `kept`: the events that
 * the gateway keeps, of all robots.
 */
export function rowsOf(alarm: RobotAlarm, history: readonly HistoryEvent[], kept: readonly GatewayEvent[]): Row[] {
  const spans = spansOf(alarm);
  const isNear = (at: number): boolean => spans.some(({ from, to }) => at >= from && at <= to);
  const outcomes = new Map<number, CommandEnd>();
  for (const event of kept) if (event.event === "command_ended") outcomes.set(event.command_id, event.outcome);
  const seen = history.map((event): Row => {
    const at = Date.parse(event.true_time ?? event.time);
    const isItself = event.event === "alarm_began" && event.code === alarm.code && event.time === alarm.since;
    return { at, key: `seen ${event.id}`, kind: "seen", event, isItself };
  });
  const deeds = kept.filter(isDeed).flatMap((event): Row[] => {
    if (event.robot !== alarm.robot) return [];
    const outcome = event.event === "command_began" ? (outcomes.get(event.command_id) ?? null) : null;
    return [{ at: Date.parse(event.time), key: `deed ${event.id}`, kind: "deed", event, outcome }];
  });
  return [...seen, ...deeds].filter(({ at }) => isNear(at)).sort((a, b) => a.at - b.at);
}

/**
 * From when on the kept events tell what was done; `null` if they tell it of the whole time line. The gateway keeps
 * the last ones of all robots, since its start.
 */
export function deedsSince(alarm: RobotAlarm, kept: readonly GatewayEvent[]): number | null {
  const oldest = kept[0];
  const from = spansOf(alarm)[0]!.from;
  if (oldest === undefined) return null;
  const at = Date.parse(oldest.time);
  return at <= from ? null : at;
}
