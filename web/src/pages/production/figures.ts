/** Figures of several robots together, and distributions of cycle times. Pure. */
import type { Production } from "../../api/types.ts";

/** A figure of the hall: of those robots that tell it. */
export interface Sum {
  /** `null` if no robot tells it. */
  value: number | null;
  /** How many tell it. */
  of: number;
  /** Those that were seen and do not. */
  missing: string[];
  /** Those that were not seen at all. */
  unseen: string[];
  /** Whether there may have been more. */
  atLeast: boolean;
}

export const STATES = ["running_ms", "waiting_ms", "alarm_ms", "manual_ms", "other_ms"] as const;

/** Whether a robot tells its cycles in the span; `null` while that is not known. */
export type Tells = boolean | null;

export interface Hall {
  seen: number;
  unseen: number;
  states: Record<(typeof STATES)[number], number>;
  availability: Sum;
  cycles: Sum;
  parts: Sum;
}

/** All robots together. `tells`: which robots tell their cycles, by name. */
export function hallOf(all: Production[], tells: ReadonlyMap<string, Tells>): Hall {
  const add = (of: (one: Production) => number): number => all.reduce((sum, one) => sum + of(one), 0);
  const states = Object.fromEntries(STATES.map((state) => [state, add((one) => one.states[state])])) as Hall["states"];
  const seen = add((one) => one.seen_ms);
  const unseen = all.filter(isUnseen).map(({ robot }) => robot);
  return {
    seen,
    unseen: add((one) => one.unseen_ms),
    states,
    availability: {
      value: seen > 0 ? states.running_ms / seen : null,
      of: all.length - unseen.length,
      missing: [],
      unseen,
      atLeast: false,
    },
    cycles: sum(all, (one) => (tellsCycles(one, tells) ? one.cycles.count : null), (one) => one.cycles.at_least),
    parts: sum(all, (one) => one.parts.count, (one) => one.parts.resets > 0),
  };
}

/** Whether nothing of the robot was seen in the span. */
export function isUnseen(one: Production): boolean {
  return one.seen_ms <= 0;
}

/** Whether the number of cycles is one: no cycle of a robot that does not tell any is not a number. */
export function tellsCycles(one: Production, tells: ReadonlyMap<string, Tells>): boolean {
  return one.cycles.count > 0 || tells.get(one.robot) === true;
}

function sum(all: Production[], of: (one: Production) => number | null, isMore: (one: Production) => boolean): Sum {
  const told = all.filter((one) => of(one) !== null);
  return {
    value: told.length === 0 ? null : told.reduce((whole, one) => whole + (of(one) as number), 0),
    of: told.length,
    missing: all.filter((one) => of(one) === null && !isUnseen(one)).map(({ robot }) => robot),
    unseen: all.filter((one) => of(one) === null && isUnseen(one)).map(({ robot }) => robot),
    atLeast: told.some(isMore),
  };
}

/** What figures were computed from, each word once. */
export function sources(all: Production[], of: (one: Production) => string[]): string[] {
  return [...new Set(all.flatMap(of))];
}

/** A part of a distribution: cycles of at least `from` and less than `to`, in milliseconds. */
export interface Bin {
  from: number;
  to: number;
  counts: number[];
}

/** Steps that people read easily. */
const STEPS = [1, 2, 5];
/** About how many bins there are. */
const BINS = 20;

/** How several sets of times are spread, over the same bins. The last bin has its end too. */
export function distribution(sets: number[][]): Bin[] {
  const all = sets.flat();
  if (all.length === 0) return [];
  const [low, high] = all.reduce(([a, b], one) => [Math.min(a, one), Math.max(b, one)], [Infinity, -Infinity]);
  const width = stepOf((high - low) / BINS);
  const begin = Math.floor(low / width) * width;
  const count = Math.floor((high - begin) / width) + 1;
  const bins = Array.from({ length: count }, (_, at) => ({
    from: begin + at * width,
    to: begin + (at + 1) * width,
    counts: sets.map(() => 0),
  }));
  sets.forEach((set, at) => {
    for (const one of set) bins[Math.floor((one - begin) / width)]!.counts[at]! += 1;
  });
  return bins;
}

function stepOf(least: number): number {
  let power = 1;
  for (;;) {
    for (const step of STEPS) if (step * power >= least) return step * power;
    power *= 10;
  }
}

/** The shifts of several robots as rows: each shift of a day once, the latest first. */
export function byShift(all: Production[]): { name: string; date: string; begin: number; isUnderWay: boolean; figures: Production[] }[] {
  const rows = new Map<string, ReturnType<typeof byShift>[number]>();
  for (const one of all) {
    if (!one.shift) continue;
    const { name, date, begin, under_way } = one.shift;
    const key = `${name}@${date}`;
    const row = rows.get(key) ?? { name, date, begin: Date.parse(begin), isUnderWay: under_way, figures: [] };
    rows.set(key, { ...row, figures: [...row.figures, one] });
  }
  return [...rows.values()].sort((a, b) => b.begin - a.begin);
}
