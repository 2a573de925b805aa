/**
 * The kinds of steps and their fields, as docs/PROGRAMS.md has them: what a new one begins with, what can be
 * added.
 */
import type { Value } from "./toml.ts";

export interface Kind {
  /** Fields that it needs. */
  needs: readonly string[];
  may: readonly string[];
  /** Whether only a taught program has it. */
  taught?: true;
}

const MANNER = ["blend", "delay", "tool", "work_frame"] as const;

export const KINDS: Readonly<Record<string, Kind>> = {
  "axis-move": { needs: ["to", "speed"], may: [...MANNER, "mask"] },
  "linear-move": { needs: ["to", "speed"], may: [...MANNER, "mask"] },
  "curve-move": { needs: ["through", "to", "speed"], may: [...MANNER, "mask"] },
  wait: { needs: [], may: ["seconds", "point", "until", "limit"] },
  output: { needs: ["point"], may: ["on", "delay", "pulse"] },
  "board-output": { needs: [], may: ["set", "clear"] },
  "stop-on-signal": { needs: [], may: ["point", "on", "watch"] },
  "path-speed": { needs: [], may: ["mm_per_s"] },
  workbench: { needs: ["number"], may: [] },
  tool: { needs: ["number"], may: [], taught: true },
  "move-to-registers": { needs: ["speed"], may: ["first", "pose", ...MANNER], taught: true },
  "move-to-point": { needs: ["speed"], may: ["above", ...MANNER], taught: true },
  "move-to-stack": { needs: ["counter", "first", "speed"], may: ["stack", "above", ...MANNER], taught: true },
  "wait-for-registers": { needs: ["first"], may: ["count", "limit"], taught: true },
  photo: { needs: [], may: ["camera", "limit", "tries", "alarm"], taught: true },
  "take-point": { needs: [], may: ["camera", "model", "limit", "else"], taught: true },
  alarm: { needs: ["number"], may: [], taught: true },
  counter: { needs: ["number"], may: ["to", "by"], taught: true },
  register: { needs: ["number"], may: ["to", "by"], taught: true },
  remote: { needs: [], may: [], taught: true },
  label: { needs: ["name"], may: [], taught: true },
  jump: { needs: ["to"], may: [], taught: true },
  if: {
    needs: ["to"],
    may: ["point", "on", "counter", "reached", "register", "at_least", "below", "equals", "points", "model", "stack", "full"],
    taught: true,
  },
  call: { needs: ["program"], may: [], taught: true },
  return: { needs: [], may: [], taught: true },
  end: { needs: [], may: [], taught: true },
};

/** What a field begins with. Numbers of moves come from points: they have no beginning. */
const FIRST: Readonly<Record<string, Value>> = {
  speed: 20,
  blend: 0,
  delay: 0,
  mask: "0x3F",
  tool: 0,
  work_frame: 0,
  seconds: 1,
  point: "X010",
  until: "on",
  limit: 10,
  on: true,
  pulse: 0.5,
  set: ["Y010"],
  clear: ["Y011"],
  watch: true,
  mm_per_s: 100,
  number: 1,
  first: 800,
  pose: false,
  above: 50,
  counter: 0,
  stack: 0,
  count: 1,
  camera: 0,
  tries: 1,
  alarm: 9,
  model: 0,
  else: "again",
  to: 0,
  by: 1,
  name: "again",
  program: "default",
  register: 800,
  points: 0,
  full: true,
  reached: true,
  at_least: 1,
  below: 1,
  equals: 1,
  skip_in_single_cycle: true,
};

/** What a field of a step of this kind begins with. */
export function first(word: string, key: string): Value {
  if (key === "point" && word === "output") return "Y010";
  if (key === "to" && (word === "jump" || word === "if")) return "again";
  if (key === "first" && word === "move-to-stack") return [0, 0, 0];
  return FIRST[key] ?? 0;
}

/** The fields that a new step has, without those of moves, which are the numbers of a point. */
export function fresh(word: string): { key: string; value: Value }[] {
  const kind = KINDS[word];
  const begun = { wait: ["seconds"], output: ["on"], "board-output": ["set"], "stop-on-signal": ["point"], if: ["point"] }[word] ?? [];
  const change = word === "counter" || word === "register" ? ["by"] : [];
  const keys = [...(kind?.needs ?? []), ...begun, ...change].filter((key) => !isTarget(word, key));
  return [{ key: "do", value: word }, ...keys.map((key) => ({ key, value: first(word, key) }))];
}

/** Whether a field has the numbers of a place. */
export function isTarget(word: string, key: string): boolean {
  return word.endsWith("-move") && (key === "to" || key === "through");
}

/** Fields that a step can still get. */
export function others(word: string, taught: boolean, present: readonly string[]): string[] {
  const kind = KINDS[word];
  if (kind === undefined) return [];
  const own = taught && word === "wait" ? ["else", "skip_in_single_cycle"] : [];
  return [...kind.needs, ...kind.may, ...own].filter((key) => !present.includes(key));
}

const UNITS: Readonly<Record<string, string>> = {
  speed: "%",
  blend: "0 – 9",
  delay: "s",
  seconds: "s",
  limit: "s",
  pulse: "s",
  mm_per_s: "mm/s",
  above: "mm",
};

/** The unit of a field; empty if it has none. */
export function unitOf(word: string, key: string): string {
  if (key === "to" && word === "axis-move") return "deg";
  if (isTarget(word, key)) return "mm, deg";
  return UNITS[key] ?? "";
}
