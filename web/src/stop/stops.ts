/**
 * All stops of the page, in the order in which they have to leave it, and what is known of each. They outlive
 * the list and the page on which they were pressed.
 *
 * A browser has six connections to a server, and a stop of a robot that does not answer takes up to 20 s. So
 * the stops of many robots leave in turn: those that may need it most first, and robots without a link last.
 * A single stop never waits for its turn.
 */
import { type StopState, SOON, stop } from "./stop.ts";

export interface Target {
  robot: string;
  hasLink: boolean;
  /** `null` if that is not known. */
  moves: boolean | null;
}

export interface By {
  csrf: string | null;
  /** Whether the page knows already that the gateway is lost. */
  isLost: boolean;
}

/** So many stops of many robots are under way at a time; of those without a link. */
export const AT_A_TIME = 4;
export const WITHOUT_LINK = 2;
/** When a stop of many is sent again, in milliseconds: a robot that answers has stood still for long by then. */
const AGAIN_OF_MANY: readonly number[] = [2_000];

interface Job {
  robot: string;
  hasLink: boolean;
  by: By;
  abort: AbortController;
  cancel(): void;
}

/** What it needs of the outside: for tests. */
export interface World {
  stop: typeof stop;
  after(ms: number, act: () => void): () => void;
}

const WORLD: World = {
  stop,
  after(ms, act) {
    const timer = setTimeout(act, ms);
    return () => clearTimeout(timer);
  },
};

export class Stops {
  private readonly known = new Map<string, StopState>();
  /** The latest stop of each robot. What an earlier one says does not count. */
  private readonly latest = new Map<string, object>();
  private queue: Job[] = [];
  private readonly underWay = new Set<Job>();
  private singles = 0;
  private readonly readers = new Set<() => void>();
  private readonly shown = new Map<string, number>();
  /** When a stop of a robot was cleared last, on the gateway's clock: a proof from before says nothing of now. */
  private readonly clearedAt = new Map<string, number>();

  constructor(private readonly world: World = WORLD) {}

  /** What is known of the last stop of a robot. */
  of(robot: string): StopState | null {
    return this.known.get(robot) ?? null;
  }

  /** The stops that have no button on the page to say what became of them, and that are not proved. */
  get apart(): { robot: string; state: StopState }[] {
    return [...this.known]
      .filter(([robot, { kind }]) => kind !== "stopped" && !this.shown.has(robot))
      .map(([robot, state]) => ({ robot, state }));
  }

  /** Whether stops are under way or wait: other requests keep away from the connections. */
  get isBusy(): boolean {
    return this.singles + this.underWay.size + this.queue.length > 0;
  }

  /** Calls this with each change. Returns what ends it. */
  onChange(act: () => void): () => void {
    this.readers.add(act);
    return () => this.readers.delete(act);
  }

  /** Stops one robot, at once. Stops of robots without a link give up their connections for it. */
  one(robot: string, by: By): void {
    const given = this.queue.filter((job) => !job.hasLink || job.robot === robot);
    this.queue = this.queue.filter((job) => !given.includes(job));
    for (const job of given) {
      job.cancel();
      if (job.robot !== robot) this.tell(job.robot, job, { kind: "not_sent", why: "given_up" });
    }
    for (const job of this.underWay) if (!job.hasLink) job.abort.abort();
    const mine = {};
    this.latest.set(robot, mine);
    this.singles += 1;
    const { csrf, isLost } = by;
    void this.world.stop(robot, csrf, (state) => this.tell(robot, mine, state), { isLost }).finally(() => {
      this.singles -= 1;
      this.next();
      this.changed();
    });
  }

  /** Stops all of these. */
  many(targets: Target[], by: By): void {
    const rank = ({ hasLink, moves }: Target): number => (!hasLink ? 3 : moves === true ? 0 : moves === null ? 1 : 2);
    const robots = new Set(targets.map(({ robot }) => robot));
    // A robot that waits already keeps one place.
    for (const job of this.queue) if (robots.has(job.robot)) job.cancel();
    this.queue = this.queue.filter((job) => !robots.has(job.robot));
    for (const { robot, hasLink } of [...targets].sort((a, b) => rank(a) - rank(b))) {
      const job: Job = { robot, hasLink, by, abort: new AbortController(), cancel: () => {} };
      job.cancel = this.world.after(SOON, () => this.tell(robot, job, { kind: "not_sent", why: "in_turn" }));
      this.latest.set(robot, job);
      this.queue.push(job);
      this.tell(robot, job, { kind: "waiting" });
    }
    // Those of an earlier press stay before those without a link of this one.
    this.queue = [...this.queue.filter((job) => job.hasLink), ...this.queue.filter((job) => !job.hasLink)];
    this.next();
  }

  /** Somebody has read what became of it. */
  dismiss(robot: string): void {
    const kind = this.known.get(robot)?.kind;
    if (kind !== "not_confirmed" && kind !== "not_sent") return;
    this.known.delete(robot);
    this.changed();
  }

  /**
   * The stop was cleared at this time of the gateway: that the arm stood says nothing of now. What was not proved stays
   * until it is read.
   */
  cleared(robot: string, at: number): void {
    this.clearedAt.set(robot, at);
    if (this.known.get(robot)?.kind !== "stopped") return;
    this.known.delete(robot);
    this.changed();
  }

  /** A button of this robot is on the page. Returns what says that it is gone: a proved stop goes with it. */
  show(robot: string): () => void {
    this.shown.set(robot, (this.shown.get(robot) ?? 0) + 1);
    this.changed();
    return () => {
      const left = (this.shown.get(robot) ?? 1) - 1;
      if (left > 0) {
        this.shown.set(robot, left);
      } else {
        this.shown.delete(robot);
        if (this.known.get(robot)?.kind === "stopped") this.known.delete(robot);
      }
      this.changed();
    };
  }

  private next(): void {
    for (;;) {
      const job = this.queue[0];
      if (job === undefined || this.underWay.size >= AT_A_TIME) return;
      const unlinked = [...this.underWay].filter((one) => !one.hasLink).length;
      if (!job.hasLink && (unlinked >= WITHOUT_LINK || this.singles > 0)) return;
      this.queue.shift();
      job.cancel();
      this.underWay.add(job);
      const { csrf, isLost } = job.by;
      const tell = (state: StopState): void => this.tell(job.robot, job, state);
      const again = job.hasLink ? AGAIN_OF_MANY : [];
      const options = { isLost, signal: job.abort.signal, again, atATime: 1 };
      void this.world.stop(job.robot, csrf, tell, options).finally(() => {
        this.underWay.delete(job);
        this.next();
        this.changed();
      });
    }
  }

  private tell(robot: string, by: object, state: StopState): void {
    if (this.latest.get(robot) !== by) return;
    if (state.kind === "stopped" && state.at.getTime() <= (this.clearedAt.get(robot) ?? -Infinity)) {
      state = { kind: "not_confirmed", why: "cleared" };
    }
    if (state.kind === "stopped" && !this.shown.has(robot)) this.known.delete(robot);
    else this.known.set(robot, state);
    this.changed();
  }

  private changed(): void {
    for (const read of this.readers) read();
  }
}

/** Those of this page. */
export const stops = new Stops();
