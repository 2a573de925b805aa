/** Reads the history of a signal in buckets, page by page. What nothing waits for any more is given up. */
import { type Failure, failureOf } from "../api/failure.ts";
import { robotPath } from "../api/paths.ts";
import { patiently } from "../api/patiently.ts";
import type { History } from "../api/types.ts";
import { type Bucket, bucketsOf } from "./buckets.ts";

/**
 * How many queries of all charts are under way. The gateway answers four at a time, for all callers. The page
 * asks three questions at a time, and one of them is left for its other parts.
 */
const MAX_UNDER_WAY = 2;
/** How many buckets an answer has, and how many answers of one signal are read. */
const LIMIT = 5_000;
const MAX_PAGES = 400;

export interface Question {
  robot: string;
  signal: string;
  /** Milliseconds since 1970. */
  from: number;
  to: number;
  /** The width of a bucket, in milliseconds. */
  width: number;
}

export type Outcome =
  /**
   * `unit`: `null` if the protocol does not tell it. `unreadable`: chunks that cannot be read. `averages`: how wide the
   * widest averages are, in milliseconds, if values of the span are gone; 0 if none is. `lacks`: whether some of the
   * values are in no average.
   */
  | {
      kind: "read";
      buckets: Bucket[];
      unit: string | null;
      unreadable: number;
      averages: number;
      lacks: boolean;
      isWhole: boolean;
    }
  | { kind: "failed"; failure: Failure }
  | { kind: "given_up" };

let underWay = 0;
const waiting: (() => void)[] = [];

function go(): void {
  while (waiting.length > 0 && underWay < MAX_UNDER_WAY) {
    underWay += 1;
    waiting.shift()?.();
  }
}

async function inTurn<T>(act: () => Promise<T>): Promise<T> {
  const turn = new Promise<void>((next) => waiting.push(next));
  go();
  await turn;
  try {
    return await act();
  } finally {
    underWay -= 1;
    go();
  }
}

/** The path of a question. */
export function pathOf({ robot, signal, from, to, width }: Question, limit: number, cursor: string | null = null): string {
  const query = new URLSearchParams({
    signal,
    from: new Date(from).toISOString(),
    to: new Date(to).toISOString(),
    ...(width > 0 ? { bucket: `${width}ms` } : {}),
    limit: String(limit),
    ...(cursor === null ? {} : { cursor }),
  });
  return robotPath(robot, `history?${query}`);
}

type Part = NonNullable<History["averages"]>[number];

/** How wide the widest of these averages are, in milliseconds; 0 without any. */
const widest = (averages: readonly Part[]): number => Math.max(0, ...averages.map(({ width_ms }) => width_ms));

/** The same of the averages that do not fit to the buckets of an answer. */
export function misfit(averages: readonly Part[]): number {
  return widest(averages.filter(({ used }) => used === "not_used" || used === "by_begin"));
}

/** The same question with buckets that averages of this width fill as a whole. */
export function fitted(question: Question, width: number): Question {
  return { ...question, from: Math.floor(question.from / width) * width, width: Math.ceil(question.width / width) * width };
}

/** Reads all of it, where values are gone in wider buckets. `more` gets what is there so far. */
export async function read(asked: Question, signal: AbortSignal, more: (buckets: Bucket[]) => void = () => {}): Promise<Outcome> {
  const buckets: Bucket[] = [];
  let question = asked;
  let [cursor, unit, unreadable, averages, lacks] = [null as string | null, null as string | null, 0, 0, false];
  for (let page = 0; page < MAX_PAGES; page += 1) {
    const answer = await inTurn(() =>
      signal.aborted ? Promise.resolve({ kind: "unknown" } as const) : patiently<History>(pathOf(question, LIMIT, cursor), signal),
    );
    if (signal.aborted) return { kind: "given_up" };
    const failure = failureOf(answer);
    if (failure !== null || answer.kind !== "ok") return failure === null ? { kind: "given_up" } : { kind: "failed", failure };
    const parts = answer.value.averages ?? [];
    const step = misfit(parts);
    // Once: an end of the span that is not on an edge does not fit in any width.
    if (step > 0 && question === asked) {
      [question, cursor, unreadable, averages, lacks] = [fitted(asked, step), null, 0, 0, false];
      buckets.length = 0;
      continue;
    }
    buckets.push(...bucketsOf(answer.value.buckets ?? [], question.width, question.to));
    averages = Math.max(averages, widest(parts));
    lacks ||= parts.some(({ used }) => used === "incomplete");
    ({ unit } = answer.value);
    unreadable += answer.value.unreadable_chunks;
    cursor = answer.value.next_cursor;
    if (cursor === null) return { kind: "read", buckets, unit, unreadable, averages, lacks, isWhole: true };
    more(buckets);
  }
  return { kind: "read", buckets, unit, unreadable, averages, lacks, isWhole: false };
}
