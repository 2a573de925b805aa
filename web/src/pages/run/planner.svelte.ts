/**
 * The preview: a plan of the gateway from where the arm stands, whether it still holds, and how it is played.
 */
import { call } from "../../api/client.ts";
import { type Failure, failureOf } from "../../api/failure.ts";
import type { ProgramPlan } from "../../api/types.ts";
import { onFrame } from "../../live/frame.ts";
import { machineOf } from "../../robots/consent.ts";
import type { View } from "../../robots/view.ts";
import { type Basis, PLAN_VOIDS, type PlanVoid, voidBy, voidByCommand } from "../../run/guard.ts";
import { hall } from "../../state/hall.svelte.ts";
import type { Planning } from "../../teach/assume.ts";
import { session } from "../../state/session.svelte.ts";
import { axesOf, framesOf, setSpeedOf } from "./seen.ts";

/** A long program takes the gateway a while. */
const PATIENCE = 30_000;
/** How often tool and work frame are asked for while a preview holds, in milliseconds. */
const FRAMES = 5_000;

export interface Planned {
  /** `null`: the model of the arm is not known, so there is no path. All else has to stay as it is all the same. */
  plan: ProgramPlan | null;
  basis: Basis;
  /** How many steps stand before the first one of the plan. */
  skipped: number;
  /** The numbers of steps, from 1, whose signals are taken to come at once. */
  waits: number[];
}

/** What the planner needs to know of the page now. */
export interface Now {
  view: View | undefined;
  /** What would be sent: a text, or a kept program with its rounds. */
  text: string;
  /** The `ETag` of the latest version of the kept program; `null` for a text. */
  version: string | null;
  /** The global speed to plan with, in percent. */
  speed: number;
}

function basisOf({ text, version, speed }: Now, view: View, frames: string | null): Basis {
  return {
    isHeard: hall.isThere,
    text,
    version,
    robot: view.name,
    machine: machineOf(view),
    model: view.summary.model,
    speed,
    setSpeed: setSpeedOf(view),
    axes: axesOf(view),
    frames,
  };
}

export class Planner {
  planned = $state.raw<Planned | null>(null);
  isVoid = $state<PlanVoid | null>(null);
  /** Whether it was run: the arm goes elsewhere then, and the next run needs another plan. */
  isTaken = $state(false);
  isPlanning = $state(false);
  /** Why there is no plan. */
  problem = $state.raw<Failure | null>(null);
  /** The time that is shown, in milliseconds from the beginning of the plan. */
  time = $state(0);
  isPlaying = $state(false);
  pace = $state<0.25 | 1 | 4>(1);
  #now: () => Now;
  #ends: (() => void)[] = [];
  #ticket = 0;
  #last: number | null = null;

  constructor(now: () => Now) {
    this.#now = now;
    this.#ends.push(
      onFrame(() => this.look()),
      hall.onEvent((event) => {
        if (this.isTaken || event.robot !== this.planned?.basis.robot || event.event !== "command_began") return;
        const reason = voidByCommand(event.command);
        if (reason !== null) this.isVoid ??= reason;
      }),
    );
    const timer = setInterval(() => {
      if (!this.isTaken) void this.lookAtFrames();
    }, FRAMES);
    this.#ends.push(() => clearInterval(timer));
  }

  end(): void {
    this.#ticket += 1;
    this.isPlaying = false;
    this.#ends.forEach((end) => end());
  }

  /** Takes the preview away: it would be of something else. */
  clear(): void {
    this.#ticket += 1;
    this.planned = null;
    this.isVoid = null;
    this.isTaken = false;
    this.isPlanning = false;
    this.problem = null;
    this.isPlaying = false;
    this.time = 0;
  }

  /** Asks the gateway what the arm would do, from where it stands now. */
  async plan({ program, skipped, waits }: Planning): Promise<void> {
    const now = this.#now();
    const { view } = now;
    if (view === undefined) return;
    this.clear();
    const ticket = this.#ticket;
    const before = basisOf(now, view, null);
    this.isPlanning = true;
    const frames = (await framesOf(view.name)) ?? null;
    // Without `from` the gateway asks the robot where it stands.
    const body = { program, robot: view.name, global_speed_percent: now.speed };
    const answer =
      view.summary.model === null
        ? null
        : await call<ProgramPlan>("POST", "/v1/programs/plan", { body, csrf: session.csrf, patience: PATIENCE });
    if (ticket !== this.#ticket) return;
    this.isPlanning = false;
    if (answer !== null && answer.kind !== "ok") {
      this.problem = failureOf(answer);
      return;
    }
    const plan = answer?.value ?? null;
    const axes = plan === null ? before.axes : (plan.samples[0]?.axes ?? null);
    this.planned = { plan, basis: { ...before, axes, frames }, skipped, waits };
    this.look();
  }

  /**
   * Asks for tool and work frame again. Says whether the preview still holds, or that there was no answer.
   */
  async lookAtFrames(): Promise<"holds" | "void" | "no_answer"> {
    const { planned } = this;
    if (planned === null || this.isVoid !== null) return "void";
    if (!session.isUsed || document.visibilityState !== "visible") return "no_answer";
    const frames = await framesOf(planned.basis.robot);
    if (this.planned !== planned) return "void";
    if (frames !== undefined && frames !== planned.basis.frames) this.isVoid ??= "frames";
    return this.isVoid !== null ? "void" : frames === undefined ? "no_answer" : "holds";
  }

  /** The plan is run now. A run that succeeds leaves the arm elsewhere, and that is no fault of the plan. */
  take(): void {
    this.isTaken = true;
  }

  /** Nothing of it was carried out: the plan holds if all is as it was. */
  giveBack(): void {
    this.isTaken = false;
    this.look();
  }

  /**
   * Looks whether the plan still holds. One that was void stays so: the arm may have been somewhere else
   * meanwhile.
   */
  look(): void {
    const { planned } = this;
    if (planned === null || this.isVoid !== null) return;
    const now = this.#now();
    const { basis } = planned;
    if (this.isTaken && now.text === basis.text) return;
    this.isTaken = false;
    this.isVoid = now.view === undefined ? "robot" : voidBy(PLAN_VOIDS, basis, basisOf(now, now.view, basis.frames));
  }

  get duration(): number {
    return this.planned?.plan?.duration_ms ?? 0;
  }

  toggle(): void {
    if (this.planned === null) return;
    if (this.isPlaying) {
      this.isPlaying = false;
      return;
    }
    if (this.time >= this.duration) this.time = 0;
    this.isPlaying = true;
    this.#last = null;
    requestAnimationFrame((now) => this.#tick(now));
  }

  show(time: number): void {
    this.isPlaying = false;
    this.time = Math.min(Math.max(0, time), this.duration);
  }

  #tick(now: number): void {
    if (!this.isPlaying) return;
    if (this.#last !== null) this.time = Math.min(this.duration, this.time + (now - this.#last) * this.pace);
    this.#last = now;
    if (this.time >= this.duration) this.isPlaying = false;
    else requestAnimationFrame((next) => this.#tick(next));
  }
}
