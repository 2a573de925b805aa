/**
 * Puts the messages of the stream together, so that the page takes many of them at once. The worker that reads the
 * stream packs, and the page unpacks: of 500 robots that are read ten times a second come 5000 messages a second,
 * and to take each by itself would keep the page busy half of the time. Pure.
 */
import type { AddressValue, LiveSent, SignalQuality } from "../api/types.ts";
import { decode } from "./decode.ts";

/** So many messages that are no changes of values wait for the page at most: some minutes of a hall in trouble. */
export const MOST = 5_000;
/** So many snapshots the page gets at once at most: it makes the tiles of a hall in several tasks, none of them long. */
export const SNAPSHOTS = 64;

const QUALITIES: readonly SignalQuality[] = ["fresh", "stale", "none"];
/** What a row of `numbers` has: place of the robot, place of the signal, value, quality, age in milliseconds. */
const ROW = 5;
/** The value is in `others`, and here is its place there. */
const OTHER = 8;
const NO_AGE = -1;

/** A signal of a robot, whose address and unit do not change. */
interface Column {
  address: string;
  unit: string | null;
}

/** Values that changed: of several changes of one value the last one. */
export interface Changes {
  type: "changes";
  numbers: Float64Array;
  others: (AddressValue | null)[];
  resume: string | null;
}

/** What the page gets at once. */
export interface Pack {
  /** Robots and signals that no pack before named: their places go on. */
  robots: string[];
  columns: Column[];
  items: (LiveSent | Changes)[];
}

/** A change of one value as the page takes it in. */
export interface Changed {
  robot: string;
  address: string;
  value: AddressValue | null;
  unit: string | null;
  quality: SignalQuality;
  /** How old the value is, in milliseconds; `null` without one. */
  age: number | null;
}

/** A row under way: when it came is known here, and how old it is when it leaves. */
interface Row {
  robot: number;
  column: number;
  value: AddressValue | null;
  quality: SignalQuality;
  asked: number | null;
}

/** What waits, in order: changes together, and each other message with the time when it came. */
type Waiting = { rows: Map<number, Row>; resume: string | null } | { sent: LiveSent; at: number };

/** Numbers things in the order in which they come. */
class Places<Of> {
  private readonly places = new Map<string, number>();
  private fresh: Of[] = [];

  of(key: string, make: () => Of): number {
    let place = this.places.get(key);
    if (place === undefined) {
      place = this.places.size;
      this.places.set(key, place);
      this.fresh.push(make());
    }
    return place;
  }

  takeFresh(): Of[] {
    const { fresh } = this;
    this.fresh = [];
    return fresh;
  }
}

export class Packer {
  private readonly robots = new Places<string>();
  private readonly columns = new Places<Column>();
  private items: Waiting[] = [];
  private heard = false;

  /** Takes in a message that came at `now`, in milliseconds. */
  add(text: string, now: number): void {
    this.heard = true;
    const sent = decode(text);
    if (sent === null) return;
    if (sent.type !== "change") {
      this.items.push({ sent, at: now });
      return;
    }
    const last = this.items.at(-1);
    const changes = last !== undefined && "rows" in last ? last : { rows: new Map<number, Row>(), resume: null };
    if (changes !== last) this.items.push(changes);
    const robot = this.robots.of(sent.robot, () => sent.robot);
    for (const { address, unit, value, quality, age_ms } of sent.signals) {
      const column = this.columns.of(`${address}\n${unit ?? ""}`, () => ({ address, unit }));
      changes.rows.set(robot * 2 ** 20 + column, { robot, column, value, quality, asked: age_ms === null ? null : now - age_ms });
    }
    if (typeof sent.resume === "string") changes.resume = sent.resume;
  }

  /** Whether something came since `take`. */
  get isEmpty(): boolean {
    return !this.heard && this.items.length === 0;
  }

  /** Whether too much waits: the page does not take it. */
  get isFull(): boolean {
    return this.items.length > MOST;
  }

  /** What waits, as it leaves at `now`. Of many snapshots some wait on. */
  take(now: number): Pack {
    let snapshots = 0;
    const isOver = (item: Waiting): boolean => "sent" in item && item.sent.type === "snapshot" && (snapshots += 1) > SNAPSHOTS;
    const end = this.items.findIndex(isOver);
    const leaving = this.items.splice(0, end < 0 ? Infinity : end);
    const items = leaving.map((item) => ("rows" in item ? flat(item.rows, item.resume, now) : older(item.sent, now - item.at)));
    this.heard = false;
    return { robots: this.robots.takeFresh(), columns: this.columns.takeFresh(), items };
  }
}

/** The values of a snapshot are as old as they are when it leaves. */
function older(sent: LiveSent, by: number): LiveSent {
  if (sent.type !== "snapshot") return sent;
  const signals = sent.signals.map((signal) => (signal.age_ms === null ? signal : { ...signal, age_ms: signal.age_ms + by }));
  return { ...sent, signals };
}

function flat(rows: Map<number, Row>, resume: string | null, now: number): Changes {
  const numbers = new Float64Array(rows.size * ROW);
  const others: (AddressValue | null)[] = [];
  let at = 0;
  for (const { robot, column, value, quality, asked } of rows.values()) {
    const isNumber = typeof value === "number";
    const kind = QUALITIES.indexOf(quality) + (isNumber ? 0 : OTHER);
    numbers[at] = robot;
    numbers[at + 1] = column;
    numbers[at + 2] = isNumber ? value : others.push(value) - 1;
    numbers[at + 3] = kind;
    numbers[at + 4] = asked === null ? NO_AGE : Math.max(0, now - asked);
    at += ROW;
  }
  return { type: "changes", numbers, others, resume };
}

/** Values that changed, for the page. */
export interface Many {
  type: "many";
  resume: string | null;
  each(): Iterable<Changed>;
}

/** Reads what a `Packer` made, pack by pack. */
export class Unpacker {
  private readonly robots: string[] = [];
  private readonly columns: Column[] = [];

  /** The messages of a pack, in order. */
  take({ robots, columns, items }: Pack): (LiveSent | Many)[] {
    this.robots.push(...robots);
    this.columns.push(...columns);
    return items.map((item) => {
      if (item.type !== "changes") return item;
      return { type: "many", resume: item.resume, each: () => this.each(item) };
    });
  }

  private *each({ numbers, others }: Changes): Generator<Changed> {
    for (let at = 0; at + ROW <= numbers.length; at += ROW) {
      const robot = this.robots[numbers[at] ?? -1];
      const column = this.columns[numbers[at + 1] ?? -1];
      if (robot === undefined || column === undefined) continue;
      const number = numbers[at + 2] ?? 0;
      const kind = numbers[at + 3] ?? 0;
      const age = numbers[at + 4] ?? NO_AGE;
      const value = kind >= OTHER ? (others[number] ?? null) : number;
      const quality = QUALITIES[kind % OTHER] ?? "none";
      yield { robot, address: column.address, unit: column.unit, value, quality, age: age === NO_AGE ? null : age };
    }
  }
}
