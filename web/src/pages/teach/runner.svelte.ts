/** A program that was sent: what is known of it. It is sent once, and never again by itself. */
import { SvelteMap } from "svelte/reactivity";
import { call, freshKey } from "../../api/client.ts";
import { robotPath } from "../../api/paths.ts";
import type { LeaseKey, Run } from "../../api/types.ts";
import { hall } from "../../state/hall.svelte.ts";
import { session } from "../../state/session.svelte.ts";
import { type Sent, isOpen, mayRun, ofRun, sentBy } from "../../teach/send.ts";

/** How often a run that is under way is asked for, in milliseconds; events tell it sooner. */
const ASK = 1_000;
/** The gateway answers once the controller has accepted the first steps. */
const PATIENCE = 15_000;

class Runner {
  /** The last program that this page sent, by robot. */
  #sent = new SvelteMap<string, Sent>();
  #texts = new SvelteMap<string, string>();
  /** Robots for which an event told that a run is under way, this page's or another's. */
  #under = new SvelteMap<string, number>();
  /** The texts that ran on a robot to their end. */
  #ran = new SvelteMap<string, string>();

  of(robot: string): Sent | null {
    return this.#sent.get(robot) ?? null;
  }

  /** Whether a program may be under way on the robot, as far as is known. */
  runs(robot: string): boolean {
    return this.#under.has(robot) || mayRun(this.of(robot));
  }

  /** The text that was sent last. */
  textOf(robot: string): string | null {
    return this.#texts.get(robot) ?? null;
  }

  /** Whether this very text ran on the robot to its end, while this page was open. */
  hasRun(robot: string, text: string): boolean {
    return this.#ran.get(robot) === text;
  }

  /** Whether it is not known what became of the last program, and the person has not said yet that it was looked at. */
  isUnknown(robot: string): boolean {
    return isOpen(this.of(robot));
  }

  forget(robot: string): void {
    if (!mayRun(this.of(robot))) this.#sent.delete(robot);
  }

  async send(robot: string, program: string, lease: LeaseKey): Promise<void> {
    if (this.runs(robot)) return;
    this.#sent.set(robot, { kind: "sent" });
    this.#ran.delete(robot);
    this.#texts.set(robot, program);
    const path = robotPath(robot, "programs/run");
    const answer = await call<Run>("POST", path, {
      body: { program, lease },
      csrf: session.csrf,
      idempotencyKey: freshKey(),
      patience: PATIENCE,
    });
    this.#tell(robot, program, sentBy(answer));
    const run = answer.kind === "ok" ? answer.value.run_id : null;
    if (run !== null) await this.#follow(robot, program, run);
  }

  /** Asks for the run until it has ended. */
  async #follow(robot: string, program: string, run: number): Promise<void> {
    const path = robotPath(robot, `runs/${run}`);
    let wake = (): void => {};
    const unread = hall.onEvent((event) => {
      if (event.robot !== robot || (event.event !== "run_progress" && event.event !== "run_ended")) return;
      if (event.run_id !== run) return;
      const now = this.of(robot);
      if (event.event === "run_progress" && now?.kind === "accepted" && now.run.run_id === run) {
        this.#sent.set(robot, { kind: "accepted", run: { ...now.run, accepted: event.accepted, done: event.done } });
      }
      if (event.event === "run_ended") wake();
    });
    while (mayRun(this.of(robot))) {
      await new Promise<void>((next) => {
        wake = next;
        setTimeout(next, ASK);
      });
      const answer = await call<Run>("GET", path);
      const before = this.of(robot);
      if (answer.kind === "ok") this.#tell(robot, program, ofRun(answer.value));
      else if (answer.kind === "refused" && answer.status === 404) this.#tell(robot, program, { kind: "unknown" });
      else if (before?.kind === "accepted") this.#sent.set(robot, { kind: "unheard", run: before.run });
      if (session.phase !== "in") {
        // Another session does not follow it.
        if (mayRun(this.of(robot))) this.#tell(robot, program, { kind: "unknown" });
        break;
      }
    }
    unread();
  }

  #tell(robot: string, program: string, sent: Sent): void {
    this.#sent.set(robot, sent);
    if (sent.kind === "ended" && sent.run.state === "done") this.#ran.set(robot, program);
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

export const runner = new Runner();
