/** Inputs, outputs and M points: words of 32 points. */
import type { Queried } from "../../api/types.ts";

/** The boards that a controller can have, and the words of M points that commands reach. */
export const MAX_BOARDS = 4;
export const M_WORDS = 3;
/** The first word of M points counts as this board in commands. */
const M_BOARD = 4;

export type PointKind = "input" | "output" | "M";

export interface Word {
  kind: PointKind;
  /** Its number: the board, from 0. */
  board: number;
  points: boolean[];
}

/** The addresses of all points of so many boards. */
export function addresses(boards: number): string[] {
  const all = Array.from({ length: Math.min(boards, MAX_BOARDS) }, (_, at) => at);
  const marks = Array.from({ length: M_WORDS }, (_, at) => `M-${at}`);
  return [...all.map((at) => `input-${at}`), ...all.map((at) => `output-${at}`), ...marks];
}

/** The words that an answer has; a word that the controller does not have is left out. */
export function wordsOf(queried: Queried): Word[] {
  const words: Word[] = [];
  for (const { address, value } of queried.signals) {
    const match = /^(input|output|M)-(\d+)$/.exec(address);
    if (match === null || typeof value !== "number") continue;
    const points = Array.from({ length: 32 }, (_, bit) => ((value >>> bit) & 1) === 1);
    words.push({ kind: match[1] as PointKind, board: Number(match[2]), points });
  }
  return words;
}

const LETTERS: Record<PointKind, string> = { input: "X", output: "Y", M: "M" };

/** The number of a point, from 1. */
export function numberOf(board: number, bit: number): number {
  return board * 32 + bit + 1;
}

/**
 * A point as the pendant calls it: point 0 is X010, in octal, and point 31 X047. How it calls those of
 * further words is not known (docs/PROTOCOL.md, section 10): they keep their numbers.
 */
export function nameOf(kind: PointKind, board: number, bit: number): string {
  if (board > 0) return String(numberOf(board, bit));
  return LETTERS[kind] + (bit + 8).toString(8).padStart(3, "0");
}

/** The arguments of `modifyOutput`: board, point and level. */
export function outputArguments(kind: "output" | "M", board: number, bit: number, isOn: boolean): string[] {
  return [String(kind === "M" ? board + M_BOARD : board), String(bit), isOn ? "1" : "0"];
}
