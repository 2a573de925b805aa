/** Programs that run on robots: what is known of them. One that was sent is never sent again by itself. */
import { SvelteMap } from "svelte/reactivity";
import { call, freshKey } from "../../api/client.ts";
import { robotPath } from "../../api/paths.ts";
import type { LeaseKey, Run } from "../../api/types.ts";
import { machineOf } from "../../robots/consent.ts";
import type { View } from "../../robots/view.ts";
import { type Sent, isOpen, mayRun, ofRun, runOf, sentBy } from "../../run/sent.ts";
import { hall } from "../../state/hall.svelte.ts";
import { session } from "../../state/session.svelte.ts";
import type { Kept } from "./stored.ts";

/** How often a run that is under way is asked for, in milliseconds; events tell it sooner. */
const ASK = 1_000;
/** A run of somebody else: events tell of it, and one that is lost is made up for. */
const ASK_OTHERS = 5_000;
/** The gateway answers once the controller has accepted the first steps. */
const PATIENCE = 20_000;

/** What runs: the text that was checked and planned. */
export interface Order {
  text: string;
  /** How often; once if it is missing. */
  repeat?: number;
  /** The kept program that the text is of. It is named, and the gateway refuses if it has another text now. */
  kept?: Kept;
}

class Runner {
  /** The last program that this page sent or followed, by robot. */
  #sent = new SvelteMap<string, Sent>();
  #orders = new SvelteMap<string, Order>();
  /** The robot as it was when this page sent its last program, and the number of the lease with which it was sent. */
  #before = new SvelteMap<string, { view: View; lease: number }>();
  /** Robots for which an event told that a run is under way, this page's or another's. */
  #under = new SvelteMap<string, number>();
  /** The texts that ran on a robot to their end, and what ran them: see `ranOn`. */
  #ran = new SvelteMap<string, { text: string; on: string }>();
  /** The last run that was followed, by robot: it is not followed again once it was seen. */
  #followed = new Map<string, number>();

  of(robot: string): Sent | null {
    return this.#sent.get(robot) ?? null;
  }

  /** Whether a program may be under way on the robot, as far as is known. */
  runs(robot: string): boolean {
    return this.#under.has(robot) || mayRun(this.of(robot));
  }

  /** The text that was sent last. */
  textOf(robot: string): string | null {
    return this.#orders.get(robot)?.text ?? null;
  }

  /**
   * Whether this very text ran on the twin to its end, in this session, for an arm of this model. What another machine
   * of the same name ran does not count: a twin that was started anew has run nothing yet. The twin of an arm whose
   * model is not configured has a usual one.
   */
  hasRun(twin: string, text: string, model: string | null): boolean {
    const ran = this.#ran.get(twin);
    if (ran === undefined || ran.text !== text || ran.on !== ranOn(twin)) return false;
    return model === null || hall.view(twin)?.summary.model === model;
  }

  /** The robot as it was before the last program was sent; `null` if another page sent it. */
  before(robot: string): View | null {
    return this.#before.get(robot)?.view ?? null;
  }

  /** Whether it is not known what became of the last program, and the person has not said yet that it was looked at. */
  isUnknown(robot: string): boolean {
    return isOpen(this.of(robot));
  }

  forget(robot: string): void {
    if (!mayRun(this.of(robot))) this.#sent.delete(robot);
  }

  async send(robot: string, order: Order, lease: LeaseKey): Promise<void> {
    if (this.runs(robot)) return;
    const on = ranOn(robot);
    this.#sent.set(robot, { kind: "sent" });
    this.#ran.delete(robot);
    this.#orders.set(robot, order);
    const before = hall.view(robot);
    if (before === undefined) this.#before.delete(robot);
    else this.#before.set(robot, { view: before, lease: lease.number });
    const { text, repeat, kept } = order;
    const path = robotPath(robot, "programs/run");
    const answer = await call<Run>("POST", path, {
      body: { ...(kept ?? { program: text }), ...(repeat === undefined ? {} : { repeat }), lease },
      csrf: session.csrf,
      idempotencyKey: freshKey(),
      patience: PATIENCE,
    });
    this.#sent.set(robot, sentBy(answer));
    const run = answer.kind === "ok" ? answer.value.run_id : null;
    if (run !== null) await this.#follow(robot, run, ASK);
    const end = this.of(robot);
    const isDone = end?.kind === "ended" && end.run.run_id === run && end.run.state === "done";
    if (isDone && on !== null && ranOn(robot) === on) this.#ran.set(robot, { text, on });
  }

  /** Follows a run that this page did not send, as events told of it. */
  async adopt(robot: string, run: number): Promise<void> {
    if (mayRun(this.of(robot)) || this.isUnknown(robot) || (this.#followed.get(robot) ?? -1) >= run) return;
    this.#followed.set(robot, run);
    const answer = await call<Run>("GET", robotPath(robot, `runs/${run}`));
    if (answer.kind !== "ok") {
      // It is asked for again with the next event.
      if (this.#followed.get(robot) === run) this.#followed.delete(robot);
      return;
    }
    if (mayRun(this.of(robot))) return;
    // A list that was refused has a run too: its number comes with the event alone.
    if (this.#before.get(robot)?.lease !== answer.value.lease) {
      this.#orders.delete(robot);
      this.#before.delete(robot);
    }
    this.#sent.set(robot, ofRun(answer.value));
    await this.#follow(robot, run, ASK_OTHERS);
  }

  /** Asks for the run until it has ended. */
  async #follow(robot: string, run: number, every: number): Promise<void> {
    this.#followed.set(robot, run);
    const path = robotPath(robot, `runs/${run}`);
    const isIt = (): boolean => runOf(this.of(robot))?.run_id === run;
    let wake = (): void => {};
    let isOver = false;
    const unread = hall.onEvent((event) => {
      if (event.robot !== robot || (event.event !== "run_progress" && event.event !== "run_ended")) return;
      if (event.run_id !== run) return;
      const now = this.of(robot);
      if (event.event === "run_progress" && now?.kind === "accepted" && isIt()) {
        this.#sent.set(robot, { kind: "accepted", run: { ...now.run, accepted: event.accepted, done: event.done } });
      }
      if (event.event === "run_ended") {
        isOver = true;
        wake();
      }
    });
    while (isIt() && mayRun(this.of(robot))) {
      await new Promise<void>((next) => {
        wake = next;
        setTimeout(next, every);
      });
      // Each question keeps the session open: of a run of somebody else events tell, if nobody uses the page.
      if (every === ASK_OTHERS && !isOver && !session.isUsed) continue;
      const answer = await call<Run>("GET", path);
      if (!isIt()) break;
      const before = runOf(this.of(robot));
      if (answer.kind === "ok") this.#sent.set(robot, ofRun(answer.value));
      else if (answer.kind === "refused" && answer.status === 404) this.#sent.set(robot, { kind: "unknown" });
      else if (before !== null) this.#sent.set(robot, { kind: "unheard", run: before });
      if (session.phase !== "in") {
        // Another session does not follow it.
        if (mayRun(this.of(robot))) this.#sent.set(robot, { kind: "unknown" });
        break;
      }
    }
    unread();
  }

  /** Looks whether a run that an event told of is still under way: events can be lost. */
  async verify(robot: string): Promise<void> {
    const run = this.#under.get(robot);
    if (run === undefined || mayRun(this.of(robot))) return;
    const answer = await call<Run>("GET", robotPath(robot, `runs/${run}`));
    const isOver = answer.kind === "ok" ? answer.value.state !== "running" : answer.kind === "refused" && answer.status === 404;
    if (isOver && this.#under.get(robot) === run) this.#under.delete(robot);
  }

  /** Follows what the gateway tells of runs of others too. */
  watch(): () => void {
    return hall.onEvent((event) => {
      if (event.event === "run_began") this.#under.set(event.robot, event.run_id);
      if (event.event === "run_ended" && this.#under.get(event.robot) === event.run_id) this.#under.delete(event.robot);
    });
  }
}

/** The session, the machine behind a name with its connection, and its model, as one text; `null` if it is not there. */
function ranOn(robot: string): string | null {
  const view = hall.view(robot);
  return view === undefined ? null : JSON.stringify([hall.era, machineOf(view), view.summary.model]);
}

export const runner = new Runner();
