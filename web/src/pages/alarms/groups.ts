/** Alarms of one cause as one line, and what alarms cost. Pure. */
import type { Production, RobotAlarm } from "../../api/types.ts";
import type { Entry } from "../../robots/attention.ts";

/** Alarms of one code that begin within this of the one before, in milliseconds, have one cause. */
export const TOGETHER = 2_000;
/** From this number of robots on they are one line. */
export const FLOOD = 4;

/** One line of what stops us now. */
export interface Line {
  key: string;
  /** The most urgent of its entries. */
  entry: Entry;
  robots: string[];
  /** The alarms that are known behind it, for those who acknowledge and shelve. */
  alarms: RobotAlarm[];
}

/** The lines, in the order of their first entries. */
export function linesOf(entries: Entry[], alarms: RobotAlarm[]): Line[] {
  const lines: Line[] = [];
  const taken = new Set<Entry>();
  for (const entry of entries) {
    if (taken.has(entry)) continue;
    const group = floodOf(entry, entries.filter((one) => !taken.has(one)));
    for (const one of group) taken.add(one);
    const robots = group.flatMap((one) => one.robots);
    const first = group.reduce((a, b) => (b.priority < a.priority ? b : a));
    lines.push({ key: group.length > 1 ? `flood ${entry.key}` : entry.key, entry: first, robots, alarms: known(group, alarms) });
  }
  return lines;
}

function known(group: Entry[], alarms: RobotAlarm[]): RobotAlarm[] {
  return group.flatMap((entry) => {
    if (entry.kind !== "alarm") return [];
    return alarms.find((one) => one.robot === entry.robots[0] && one.code === entry.code && one.state !== "ended") ?? [];
  });
}

/** The entries of the same cause as this one, if they are many; else this one alone. */
function floodOf(entry: Entry, entries: Entry[]): Entry[] {
  if (entry.kind !== "alarm" || entry.since === null) return [entry];
  const same = entries
    .filter((one) => one.kind === "alarm" && one.code === entry.code && one.since !== null)
    .sort((a, b) => a.since! - b.since!);
  const place = same.indexOf(entry);
  let [begin, end] = [place, place];
  while (begin > 0 && same[begin]!.since! - same[begin - 1]!.since! <= TOGETHER) begin -= 1;
  while (end + 1 < same.length && same[end + 1]!.since! - same[end]!.since! <= TOGETHER) end += 1;
  return end - begin + 1 >= FLOOD ? same.slice(begin, end + 1) : [entry];
}

/** The alarm that ended last, of those that were seen; `null` if none is known. */
export function lastEnd(alarms: RobotAlarm[]): { at: string; isSeen: boolean } | null {
  let last: { at: string; isSeen: boolean } | null = null;
  for (const { until, end_seen: isSeen } of alarms) {
    if (until !== null && (last === null || Date.parse(until) > Date.parse(last.at))) last = { at: until, isSeen };
  }
  return last;
}

/**
 * For how long an alarm that ended was there, in seconds, as far as its begin and its end were seen. `null`: neither was,
 * so nothing is known.
 */
export function lasted(alarm: Pick<RobotAlarm, "since" | "until" | "begin_seen" | "end_seen">): { seconds: number; is: "exact" | "most" | "least" } | null {
  const { since, until, begin_seen: begin, end_seen: end } = alarm;
  if (until === null || (!begin && !end)) return null;
  const seconds = (Date.parse(until) - Date.parse(since)) / 1000;
  return { seconds, is: begin && end ? "exact" : begin ? "most" : "least" };
}

/** What is shelved: each code of a robot once. */
export function shelvedOf(alarms: RobotAlarm[]): RobotAlarm[] {
  const found = new Map<string, RobotAlarm>();
  for (const alarm of alarms) {
    const key = `${alarm.robot} ${alarm.code}`;
    if (alarm.shelved !== null && !found.has(key)) found.set(key, alarm);
  }
  return [...found.values()].sort((a, b) => Date.parse(a.shelved!.until) - Date.parse(b.shelved!.until));
}

/** One code of the Pareto. */
export interface Cost {
  code: number;
  text: string;
  remedy: string;
  /** How often it was seen to begin. */
  count: number;
  /** For how long it was read, all robots together, in milliseconds. */
  lost: number;
  robots: string[];
  /** Its part of the time that all of these lost, and of it and those before it. From 0 to 1. */
  part: number;
  sum: number;
}

/** What each code cost, the dearest first. `hidden`: how many codes of robots the gateway left out. */
export function pareto(figures: Production[]): { costs: Cost[]; lost: number; hidden: number } {
  const codes = new Map<number, Omit<Cost, "part" | "sum">>();
  let hidden = 0;
  for (const { robot, alarms } of figures) {
    hidden += alarms.codes - alarms.top.length;
    for (const { code, text, remedy, count, lost_ms } of alarms.top) {
      const of = codes.get(code) ?? { code, text, remedy, count: 0, lost: 0, robots: [] };
      codes.set(code, { ...of, count: of.count + count, lost: of.lost + lost_ms, robots: [...of.robots, robot] });
    }
  }
  const sorted = [...codes.values()].sort((a, b) => b.lost - a.lost || b.count - a.count || a.code - b.code);
  const lost = sorted.reduce((all, one) => all + one.lost, 0);
  let sum = 0;
  const costs = sorted.map((one) => {
    sum += one.lost;
    return { ...one, part: lost > 0 ? one.lost / lost : 0, sum: lost > 0 ? sum / lost : 0 };
  });
  return { costs, lost, hidden };
}
