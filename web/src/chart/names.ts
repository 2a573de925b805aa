/** Signals by their names. */
import type { en } from "../i18n/en.ts";

const POSE = ["X", "Y", "Z", "U", "V", "W", "M7", "M8"];

/** The name of a signal for people. */
export function nameOf(address: string, words: typeof en): string {
  const [, kind, number] = /^(axis|world)-(\d+)$/.exec(address) ?? [];
  if (kind === "axis") return `J${Number(number) + 1}`;
  if (kind === "world") return POSE[Number(number)] ?? address;
  return words.robot.signals[address] ?? address;
}

/**
 * The colours of lines: classes of the page and names of its tokens. From the seventh on, lines are dashed.
 */
export const COLOURS = 6;

/** The sign of the colour of a line, and whether it is dashed: colours come again. */
export function lookOf(address: string, at: number): { colour: number; isDashed: boolean } {
  const axis = /^(?:axis|world)-(\d+)$/.exec(address)?.[1];
  const place = axis === undefined ? at : Number(axis);
  return { colour: (place % COLOURS) + 1, isDashed: place >= COLOURS };
}

/**
 * Signals that one scale fits: axes, places, angles, and others by their units. Eight at most are together.
 */
export function groupsOf(signals: string[], unit: (address: string) => string | null): string[][] {
  const groups = new Map<string, string[]>();
  for (const signal of signals) {
    const [, kind, number] = /^(axis|world)-(\d+)$/.exec(signal) ?? [];
    const of = kind === "world" ? (Number(number) < 3 ? "place" : "angle") : (kind ?? unit(signal) ?? signal);
    groups.set(of, [...(groups.get(of) ?? []), signal]);
  }
  return [...groups.values()].flatMap((group) =>
    Array.from({ length: Math.ceil(group.length / MOST) }, (_, at) => group.slice(at * MOST, (at + 1) * MOST)),
  );
}

/** How many lines a chart has at most. */
const MOST = 8;
