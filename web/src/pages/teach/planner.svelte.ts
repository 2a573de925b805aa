/**
 * The preview: a plan of the gateway from where the arm stands, whether it still holds, and how it is played.
 */
import { call } from "../../api/client.ts";
import { robotPath } from "../../api/paths.ts";
import type { ProgramPlan, Queried } from "../../api/types.ts";
import { onFrame } from "../../live/frame.ts";
import type { View } from "../../robots/view.ts";
import { hall } from "../../state/hall.svelte.ts";
import { session } from "../../state/session.svelte.ts";
import { type Basis, type Void, framesInUse, voidBy, voidByCommand } from "../../teach/preview.ts";
import { stateOf } from "../robot/live.ts";
import { problemText } from "./say.ts";

/** A long program takes the gateway a while. */
const PATIENCE = 30_000;
/** How often tool and work frame are asked for while a preview holds, in milliseconds. */
const FRAMES = 5_000;

export interface Planned {
  plan: ProgramPlan;
  basis: Basis;
  /** How many steps stand before the first one of the plan. */
  skipped: number;
  /** The numbers of steps, from 1, whose signals are taken to come at once. */
  waits: number[];
}

/** What the planner needs to know of the page now. */
export interface Now {
  view: View | undefined;
  /** What would be sent. */
  text: string;
  speed: number;
}

/** What is planned in place of the text: see `assumed`. */
export interface Planning {
  program: string;
  skipped: number;
  waits: number[];
}

/** Where the axes of a robot stand; `null` if that is not known now. */
export function axesOf(view: View | undefined): number[] | null {
  const robot = view === undefined ? undefined : hall.store.robots.get(view.name);
  if (view === undefined || robot === undefined || !hall.isThere || view.summary.link !== "up") return null;
  const axes: number[] = [];
  for (let at = 0; at < 8; at += 1) {
    const address = `axis-${at}`;
    const read = robot.values.get(address);
    if (read === undefined || read.value === null) break;
    if (typeof read.value !== "number" || stateOf(view.name, address).kind !== "fresh") return null;
    axes.push(read.value);
  }
  return axes.length > 0 ? axes : null;
}

export function machineOf(view: View): string {
  const { virtual, identity, identity_changed } = view.summary;
  return JSON.stringify([identity, identity_changed, virtual]);
}

/** The global speed that was set last over the gateway, in percent; `null` if it is not known. */
function setSpeedOf(view: View): number | null {
  return view.summary.global_speed?.percent ?? null;
}

/**
 * Tool and work frame in use, as one text; `null` if the robot does not tell them; `undefined` without an
 * answer.
 */
export async function framesOf(robot: string): Promise<string | null | undefined> {
  const path = robotPath(robot, `query?address=toolCoord`);
  const answer = await call<Queried>("GET", path);
  if (answer.kind !== "ok") return undefined;
  const signal = answer.value.signals.find(({ address }) => address === "toolCoord");
  return signal === undefined || signal.value === null || signal.quality !== "fresh" ? null : JSON.stringify(signal.value);
}

export class Planner {
  planned = $state.raw<Planned | null>(null);
  isVoid = $state<Void | null>(null);
  isPlanning = $state(false);
  /** Why there is no plan: the words of the gateway, or empty if it did not answer. */
  problem = $state<string | null>(null);
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
      onFrame(() => this.#look()),
      hall.onEvent((event) => {
        if (event.robot !== this.planned?.basis.robot || event.event !== "command_began") return;
        const reason = voidByCommand(event.command);
        if (reason !== null) this.isVoid ??= reason;
      }),
    );
    const timer = setInterval(() => void this.lookAtFrames(), FRAMES);
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
    this.isPlanning = false;
    this.problem = null;
    this.isPlaying = false;
    this.time = 0;
  }

  /** Asks the gateway what the arm would do, from where it stands now. */
  async plan({ program, skipped, waits }: Planning): Promise<void> {
    const { view, text, speed } = this.#now();
    if (view === undefined) return;
    this.clear();
    const ticket = this.#ticket;
    const machine = machineOf(view);
    this.isPlanning = true;
    const frames = await framesOf(view.name);
    // Without `from` the gateway asks the robot where it stands.
    const body = { program, robot: view.name, global_speed_percent: speed };
    const answer = await call<ProgramPlan>("POST", "/v1/programs/plan", { body, csrf: session.csrf, patience: PATIENCE });
    if (ticket !== this.#ticket) return;
    this.isPlanning = false;
    if (answer.kind !== "ok") {
      this.problem = problemText(answer);
      return;
    }
    const first = answer.value.samples[0]?.axes ?? null;
    const basis: Basis = {
      text,
      robot: view.name,
      machine,
      model: view.summary.model,
      speed,
      setSpeed: setSpeedOf(view),
      axes: first,
      frames: frames ?? null,
    };
    this.planned = { plan: answer.value, basis, skipped, waits };
    if (framesInUse(basis.frames)) this.isVoid = "frames_in_use";
    this.#look();
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

  /** A preview that was void stays so: the arm may have been somewhere else meanwhile. */
  #look(): void {
    const { planned } = this;
    if (planned === null || this.isVoid !== null) return;
    const { view, text, speed } = this.#now();
    const { basis } = planned;
    if (view === undefined) {
      this.isVoid = "robot";
      return;
    }
    this.isVoid = voidBy(basis, {
      text,
      robot: view.name,
      machine: machineOf(view),
      model: view.summary.model,
      speed,
      setSpeed: setSpeedOf(view),
      axes: axesOf(view),
      frames: basis.frames,
    });
  }

  get duration(): number {
    return this.planned?.plan.duration_ms ?? 0;
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
