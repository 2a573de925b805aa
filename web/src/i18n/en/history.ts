/** The history: its choices, its events and its files. */
import type { HistoryEvent } from "../../api/types.ts";
import { count, duration } from "./say.ts";

const BECAUSE: Record<string, string> = {
  link: "the connection ended, or nothing came",
  late: "the gateway was too slow, or its machine slept",
  start: "the gateway started, or the robot was changed",
  lost: "values could not be kept",
  unread: "the robot answered without this value",
  another_robot: "another robot answered",
};

const KINDS: Record<string, string> = {
  main: "All but cycles and parts",
  alarms: "Alarms",
  links: "Links and time not seen",
  cycles: "Cycles and parts",
  all: "All",
};

/** `mode`: the name of a mode. `time`: a time of the hall as a text; behind `from`, as the end of a span. */
function event(of: HistoryEvent, mode: (number: number) => string, time: (at: string, from?: string | null) => string): string {
  switch (of.event) {
    case "alarm_began":
      return `Alarm ${of.code} began: ${of.text}`;
    case "alarm_ended":
      return `Alarm ${of.code} ended${of.lasted_ms === null ? "" : ` after ${duration(of.lasted_ms / 1000)}`}: ${of.text}`;
    case "mode_changed":
      return `Mode: ${mode(of.from)} → ${mode(of.to)}`;
    case "program_changed":
      return `Program: ${of.from || "not named"} → ${of.to || "not named"}`;
    case "cycle_done":
      return `${of.at_least ? "At least " : ""}${count(of.count, "cycle", "cycles")} done${of.ms === null ? "" : `, ${(of.ms / 1000).toFixed(2)} s`}`;
    case "parts":
      return `${count(of.added, "part", "parts")} more, ${of.total} in all (${of.counter})`;
    case "parts_reset":
      return `The counter of parts went from ${of.from} to ${of.to} (${of.counter})`;
    case "link_lost":
      return "Link lost";
    case "link_back":
      return "Link back";
    case "unseen":
      return `Not seen ${of.from === null ? "" : `from ${time(of.from)} `}to ${time(of.to, of.from)}: ${BECAUSE[of.because] ?? of.because}`;
    default:
      return of.event;
  }
}

export const history = {
  choose: "What to show",
  robots: "Robots",
  signals: "Signals",
  empty: "Choose a robot and a signal.",
  noSignals: "Choose a signal.",
  noRobots: "No robot yet. An admin adds one on the page of connections, or in the file of the gateway.",
  most: (n: number) => `${count(n, "robot", "robots")} at most.`,
  missing: (robot: string) => `${robot} is not there, or you may not see it.`,
  charts: (robot: string) => `Charts of ${robot}`,
  happened: "What happened",
  kinds: (kind: string) => KINDS[kind] ?? kind,
  show: "Show",
  event,
  time: "Time",
  robot: "Robot",
  what: "What",
  noEvents: "Nothing of this kind was seen in this span.",
  more: "There are more. Choose a shorter span, or one kind.",
  moreRows: (n: number) => `Show ${n} more`,
  rows: (shown: number, all: number) => `The latest ${shown} of ${all}`,
  again: "Read again",
  reading: "Reading what happened…",
  eventsOf: (robot: string) => `What happened at ${robot}`,
  unreadable: (n: number) => `${count(n, "part of the history", "parts of the history")} cannot be read and are missing.`,
  exports: "Files",
  exportHint: "Times in the files are UTC.",
  values: "Values",
  each: "Each kept value",
  averages: (text: string) => `Averages of ${text}`,
  widths: (width: string) => ({ "1s": "1 s", "1m": "1 min", "1h": "1 h" })[width] ?? width,
  fileOf: (what: string, kind: string) => `${what} as ${kind}`,
  events: "Events",
  progress: (name: string, pages: number) => `${name}: ${count(pages, "part", "parts")}…`,
  saved: (names: string) => `Saved as ${names}.`,
  cut: (name: string) => `${name} has the begin of the span only: it is too long. Choose a shorter span for the rest.`,
};

/** A choice of several. */
export const choice = {
  add: "Add…",
  remove: (name: string) => `Take ${name} away`,
  clear: "Take all away",
};
