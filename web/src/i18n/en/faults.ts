/** Words of the faults that a virtual robot can be given. */
import { duration } from "./say.ts";

const NAMES: Record<string, string> = {
  refuse: "Connections are refused",
  "black-hole": "Attempts to connect get no answer",
  silence: "New connections are never answered",
  "reset-mid-frame": "Connections are reset in a frame",
  "close-before-reply": "Connections are closed before the reply",
  "half-open": "Connections go deaf",
  pieces: "Frames come in pieces",
  coalesce: "Several frames come at once",
  latency: "The link is late",
  slow: "The link is slow",
  noise: "Bytes are changed on the link",
  stall: "Half of a frame comes late",
  "bad-json": "Replies are broken JSON",
  "bad-field": "A field of replies is wrong",
  "bad-pack-id": "Replies have a wrong packID",
  "late-reply": "Replies come late",
  "crossed-reply": "Replies go to all clients",
  "bad-list": "Values do not fit their addresses",
  echo: "Requests come back as replies",
  unsolicited: "Frames come that nobody asked for",
  "not-executed": "Commands are accepted and not carried out",
  "not-acknowledged": "Commands are carried out and not answered",
  "list-full": "The instruction list is full",
  "list-frozen": "The instruction list does not begin",
  "rejected-mid-batch": "Half of a list is carried out and refused",
  "task-dead": "Only heartbeats are answered",
  "frozen-values": "Values do not change",
  "stop-ignored": "Stops are ignored",
  dwell: "The arm rests at each point",
  "late-list": "Lists are taken late",
};

export const faults = {
  title: "Faults",
  what: "What can go wrong with a controller and its link, to see how programs take it.",
  none: "No fault is in force.",
  /** A fault of a newer gateway has its own word. */
  named: (word: string) => NAMES[word] ?? word,
  inForce: (name: string, kind: string | null, percent: number, left: number | null) =>
    `${name}${kind === null ? "" : ` (${kind})`}${percent < 100 ? `, ${percent} %` : ""}${
      left === null ? "" : `, ends in ${duration(left)}`
    }`,
  fault: "Fault",
  kind: "Kind",
  chance: "How often, percent",
  seconds: "Seconds; empty: until ended",
  begin: "Begin",
  begins: (name: string) => `Begin: ${name}`,
  end: "End",
  ends: (name: string) => `End: ${name}`,
  endAll: "End all faults",
  cutPower: "Cut the power",
  powerOff: "The power is cut.",
  wrong: "1 to 100 percent, 1 to 86400 seconds.",
};
