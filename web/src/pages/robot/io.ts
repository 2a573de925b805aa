/** Inputs and outputs: words of 32 points. */
import type { Queried } from "../../api/types.ts";

/** The boards that a controller can have. */
export const MAX_BOARDS = 4;

export interface Word {
  kind: "input" | "output";
  /** The number of the first point, from 1. */
  first: number;
  points: boolean[];
}

/** The addresses of all points of so many boards. */
export function addresses(boards: number): string[] {
  const all = Array.from({ length: Math.min(boards, MAX_BOARDS) }, (_, at) => at);
  return [...all.map((at) => `input-${at}`), ...all.map((at) => `output-${at}`)];
}

/** The words that an answer has; a word that the controller does not have is left out. */
export function wordsOf(queried: Queried): Word[] {
  const words: Word[] = [];
  for (const { address, value } of queried.signals) {
    const match = /^(input|output)-(\d+)$/.exec(address);
    if (match === null || typeof value !== "number") continue;
    const points = Array.from({ length: 32 }, (_, bit) => ((value >>> bit) & 1) === 1);
    words.push({ kind: match[1] as Word["kind"], first: Number(match[2]) * 32 + 1, points });
  }
  return words;
}
