/**
 * The lease of one robot, if this page holds it. It is renewed while somebody uses the page. It does not
 * survive a lost gateway, a hidden page or the page's end.
 */
import { type Answer, call } from "../api/client.ts";
import { robotPath } from "../api/paths.ts";
import type { Lease, LeaseKey } from "../api/types.ts";
import { hall } from "./hall.svelte.ts";
import { session } from "./session.svelte.ts";

/** How long the gateway keeps it without a renewal, and how often it is renewed, in milliseconds. */
const LASTS = 15_000;
const RENEW = 5_000;
/** Taking it over waits until the robot is stopped: for this time at most, in milliseconds. */
const STOPS = 25_000;
/** A hidden page gives it back after this time. */
export const HIDDEN = 30_000;

class LeaseState {
  robot = $state<string | null>(null);
  /** The robot whose lease ended without being given back: its page says so. */
  ended = $state<string | null>(null);
  isAsking = $state(false);
  #key: LeaseKey | null = null;
  #timer: ReturnType<typeof setInterval> | null = null;
  #hidden: ReturnType<typeof setTimeout> | null = null;
  /** The number of the last take. A lease that an earlier take gets is given back. */
  #takes = 0;

  /** What commands for this robot send; `null` if this page does not hold its lease. */
  key(robot: string): LeaseKey | null {
    return this.robot === robot ? this.#key : null;
  }

  get number(): number | null {
    return this.#key?.number ?? null;
  }

  /** `because`: takes it from its holder, for this reason. The gateway stops the robot first. */
  async take(robot: string, because?: string): Promise<Answer<Lease>> {
    await this.give();
    const ticket = (this.#takes += 1);
    this.isAsking = true;
    this.ended = null;
    const path = robotPath(robot, "lease");
    const body = { duration_ms: LASTS, ...(because === undefined ? {} : { take_because: because }) };
    const patience = because === undefined ? {} : { patience: STOPS };
    const answer = await call<Lease>("POST", path, { body, csrf: session.csrf, ...patience });
    if (ticket === this.#takes) this.isAsking = false;
    if (answer.kind === "ok") {
      const { lease } = answer.value;
      if (ticket !== this.#takes || isHidden()) {
        // The page was left, hidden or lost the gateway meanwhile, or asked for another robot.
        await call("DELETE", path, { body: { lease }, csrf: session.csrf, keepalive: true });
        if (ticket === this.#takes) this.ended = robot;
        return answer;
      }
      this.#key = lease;
      this.robot = robot;
      this.#timer = setInterval(() => void this.#renew(), RENEW);
    }
    return answer;
  }

  /** Gives it back. Without one, does nothing. */
  async give(): Promise<void> {
    this.#overtake();
    const { robot } = this;
    const lease = this.#key;
    this.#forget();
    if (robot === null || lease === null) return;
    const path = robotPath(robot, "lease");
    await call("DELETE", path, { body: { lease }, csrf: session.csrf, keepalive: true });
  }

  /** The gateway told that this lease ended, or cannot be heard. */
  lost(): void {
    this.#overtake();
    if (this.#key === null) return;
    const { robot } = this;
    this.#forget();
    this.ended = robot;
  }

  /** The page was hidden or shown again. */
  visible(isVisible: boolean): void {
    if (this.#hidden !== null) clearTimeout(this.#hidden);
    this.#hidden = null;
    if (isVisible || this.#key === null) return;
    this.#hidden = setTimeout(() => {
      const { robot } = this;
      if (robot === null) return;
      void this.give();
      this.ended = robot;
    }, HIDDEN);
  }

  async #renew(): Promise<void> {
    const { robot } = this;
    const renew = this.#key;
    if (robot === null || renew === null) return;
    if (!session.isUsed) {
      await this.give();
      this.ended = robot;
      return;
    }
    const path = robotPath(robot, "lease");
    const body = { renew, duration_ms: LASTS };
    const answer = await call("POST", path, { body, csrf: session.csrf, patience: RENEW });
    if (this.#key !== renew) return;
    // The lease goes on for a while: a gateway that has too much to do is asked again.
    if (answer.kind === "refused" && answer.status !== 429) this.lost();
  }

  /** The page of the robot is left: what is asked for is not wanted any more. */
  leave(): void {
    if (this.isAsking) this.#overtake();
  }

  /** What is asked for now is not wanted any more. */
  #overtake(): void {
    this.#takes += 1;
    this.isAsking = false;
  }

  #forget(): void {
    if (this.#timer !== null) clearInterval(this.#timer);
    this.#timer = null;
    this.#key = null;
    this.robot = null;
  }
}

function isHidden(): boolean {
  return typeof document !== "undefined" && document.visibilityState === "hidden";
}

export const lease = new LeaseState();

/** Follows what the gateway tells of leases. */
export function watchLease(): () => void {
  return hall.onEvent((event) => {
    if (event.event === "lease_ended" && event.robot === lease.robot && event.lease === lease.number) lease.lost();
  });
}
