/** The robots, the alarms and the connection, as the pages see them. */
import { call, echo, goByClock } from "../api/client.ts";
import { robotPath } from "../api/paths.ts";
import type { GatewayEvent, LiveSent, RobotAlarm, RobotAlarms, RobotState, Settings } from "../api/types.ts";
import { clock } from "../i18n/format.ts";
import { touch } from "../live/frame.ts";
import { ANSWER, Late } from "../live/late.ts";
import type { Many } from "../live/pack.ts";
import { connect } from "../live/remote.ts";
import { Link } from "../live/socket.ts";
import { Store } from "../live/store.ts";
import { Standing } from "../robots/standing.ts";
import { type View, viewOf } from "../robots/view.ts";
import { goBy } from "../stop/stop.ts";
import { stops } from "../stop/stops.ts";
import { session } from "./session.svelte.ts";
import { followZone } from "./zone.ts";

/**
 * How often ages are written and the way to the gateway is measured, in milliseconds. The answers have whole seconds:
 * those of other parts of a second make the bound of `late.ts` exact.
 */
const AGES = 500;
const MEASURE = 5_300;
/** The first measures, and those after one without an answer, come sooner. */
const SOONER = 1_300;
const FIRST = 4;
/** By so much the page's clock and the browser's time of day may differ more than before; more is a sleep, or a clock that was set. */
const SLEPT = 1_000;
/** Alarms that come together are asked for once. */
const TOGETHER = 200;
/** How long a question that had no answer waits to be asked again. */
const AGAIN = 2_000;
/** So often it is asked who answers. Each question keeps the session open. */
const TRIES = 5;

class Hall {
  readonly store = new Store();
  /** In the order of their names, which never changes. `null` until the first one came. */
  views = $state.raw<View[] | null>(null);
  /** Whether all robots came. Before that, nothing can be said of all of them. */
  isWhole = $state(false);
  /** The active ones; `null` if they are not known. */
  alarms = $state.raw<RobotAlarm[] | null>(null);
  /** Of when is what is shown, on the page's clock, if the gateway is lost; `null` if it is there. */
  heard = $state<number | null>(null);
  /** Whether it is lost and its connection did not end: gateway or network hang. */
  isSilent = $state(false);
  /** The same, if nothing proves that it is less than 4 s old. */
  #quiet = $state<number | null>(null);
  /** When the last question left, if it had no answer in time. */
  #unanswered = $state<number | null>(null);
  /** When the connection began, or was back. */
  #backAt = 0;
  /** Whether messages come, but too late. */
  #isLate = $state(false);
  /** Whether a clock was set, or the computer slept: until something is proved anew, ages are not known. */
  isAgeUnknown = $state(false);
  /** Whether something came over the connection yet. */
  isConnected = $state(false);
  latency = $state<number | null>(null);
  /** Whether the gateway told its time. Before that, times are those of the browser, which may be wrong. */
  hasClock = $state(false);
  zone = $state("UTC");
  /** Whether the gateway told the zone; `null` before its first answer. Until then times are in UTC. */
  hasZone = $state<boolean | null>(null);
  #endZone = (): void => {};
  /** What the gateway's clock is before the page's, in milliseconds. */
  #ahead = Date.now() - performance.now();
  #late = new Late();
  #apart = Date.now() - performance.now();
  /** Another number for each session: in an earlier one, at another gateway, the same name may have been another robot's. */
  era = 0;
  #link: Link | null = null;
  #dirty = new Set<string>();
  readonly #standing = new Standing();
  #isScheduled = false;
  #timers: ReturnType<typeof setInterval>[] = [];
  #alarmTimer: ReturnType<typeof setTimeout> | null = null;
  /** The link for which the alarms are asked for now, and whether they changed meanwhile. */
  #alarmsFor: Link | null = null;
  #alarmsAgain = false;
  #readers = new Set<(event: GatewayEvent) => void>();

  /** Whether the gateway is there, and was heard just now. */
  get isThere(): boolean {
    return this.isConnected && this.since === null;
  }

  /**
   * Of when is what is shown, on the page's clock, if the gateway is lost, silent or slow; `null` if it is proved to
   * be of now.
   */
  get since(): number | null {
    const old = [this.#quiet ?? this.#link?.old() ?? null, this.#unanswered].filter((at) => at !== null);
    return this.heard ?? (old.length === 0 ? null : Math.min(...old));
  }

  /** Whether the gateway is heard, but too late. */
  get isSlow(): boolean {
    return this.heard === null && this.since !== null && (this.#isLate || this.#quiet === null);
  }

  /** Whether all robots are known, as they are now. */
  get isSure(): boolean {
    return this.isThere && this.isWhole;
  }

  now(): number {
    return performance.now();
  }

  /** A time of the page's clock as one of the gateway's, in milliseconds since 1970. */
  time(pageMillis: number): number {
    return pageMillis + this.#ahead;
  }

  /**
   * A time of the gateway on the clock of the hall; with its date if it is not of today. `from`: it is the end of a span
   * that begins there, and has its date if it is not of the same day.
   */
  clock(at: number | string, from: number | string | null = null): string {
    const millis = (of: number | string): number => (typeof of === "number" ? of : Date.parse(of));
    return clock(millis(at), this.zone, from === null ? this.time(this.now()) : millis(from));
  }

  view(name: string): View | undefined {
    return this.views?.find((view) => view.name === name);
  }

  /** Calls this with each event. Returns what ends it. */
  onEvent(act: (event: GatewayEvent) => void): () => void {
    this.#readers.add(act);
    return () => this.#readers.delete(act);
  }

  begin(): void {
    this.end();
    const world = {
      open: (path: string) => connect(location.origin.replace(/^http/, "ws") + path),
      now: () => performance.now(),
      left: (time: number, now: number) => this.#late.left(time, now),
      after: (ms: number, act: () => void) => {
        const timer = setTimeout(act, ms);
        return () => clearTimeout(timer);
      },
      isSignedIn: async () => {
        const answer = await call("GET", "/v1/session");
        if (answer.kind === "unknown") return null;
        return answer.kind === "ok" || answer.status !== 401;
      },
    };
    this.#link = new Link(world, {
      message: (sent, now) => this.#take(sent, now),
      state: (heard, isSilent) => {
        this.heard = heard;
        this.isSilent = isSilent;
        if (heard !== null) {
          this.store.lost();
          // What they did meanwhile was not seen.
          this.#standing.clear();
          this.isWhole = false;
        } else {
          this.isConnected = true;
          // The connection is an answer to a later question.
          this.#unanswered = null;
          this.#backAt = performance.now();
          this.readAlarms();
        }
        touch();
      },
      quiet: (heard, isSlow) => {
        this.#quiet = heard;
        if (heard === null) this.isAgeUnknown = false;
        this.#isLate = isSlow;
        touch();
      },
      signedOut: () => session.ended(),
      resume: () => this.store.resume,
      forgetResume: () => {
        this.store.resume = null;
      },
    });
    this.#link.start();
    this.#timers.push(setInterval(() => this.#age(), AGES));
    void this.#measureOn(this.#link);
    const about = {
      after: world.after,
      read: async () => {
        const answer = await call<Settings>("GET", "/v1/settings");
        return answer.kind === "ok" ? answer.value.time_zone : null;
      },
      get isUsed() {
        return session.isUsed && hall.isThere;
      },
    };
    this.#endZone = followZone(about, (zone) => {
      if (zone === null) this.hasZone = false;
      else this.takeZone(zone);
    });
  }

  /** The zone of the hall is this one by now. */
  takeZone(zone: string): void {
    this.zone = zone;
    this.hasZone = true;
  }

  /** Forgets everything: another user may see other robots. */
  end(): void {
    this.#endZone();
    this.hasZone = null;
    this.era += 1;
    this.#link?.end();
    this.#link = null;
    this.#timers.forEach((timer) => clearInterval(timer));
    this.#timers = [];
    this.store.clear();
    this.#standing.clear();
    this.views = null;
    this.isWhole = false;
    this.alarms = null;
    this.heard = null;
    this.#quiet = null;
    this.isAgeUnknown = false;
    this.#unanswered = null;
    this.isConnected = false;
    this.hasClock = false;
  }

  hurry(): void {
    this.#link?.hurry();
  }

  /** Reads the active alarms again. */
  readAlarms(): void {
    if (this.#alarmTimer !== null) return;
    this.#alarmTimer = setTimeout(() => {
      this.#alarmTimer = null;
      const link = this.#link;
      if (link !== null && this.#alarmsFor === link) {
        this.#alarmsAgain = true;
        return;
      }
      this.#alarmsFor = link;
      void call<RobotAlarms>("GET", "/v1/alarms?active=true&limit=1000").then((answer) => {
        if (this.#alarmsFor === link) {
          this.#alarmsFor = null;
          if (this.#alarmsAgain) this.readAlarms();
          this.#alarmsAgain = false;
        }
        if (link === null || link !== this.#link) return;
        this.alarms = answer.kind === "ok" ? answer.value.alarms : null;
        const isPart = answer.kind === "ok" && answer.value.not_known.length > 0;
        const mayWork = isPart || answer.kind === "unknown" || (answer.kind === "refused" && (answer.status >= 500 || answer.status === 429));
        if (mayWork && this.heard === null) setTimeout(() => this.readAlarms(), AGAIN);
      });
    }, TOGETHER);
  }

  #take(sent: LiveSent | Many, now: number): void {
    if (sent.type === "alive") {
      this.hasClock = true;
      const [time, came] = [Date.parse(sent.time), performance.now()];
      const left = this.#late.left(time, came);
      // The way takes less than a bound with whole seconds, unless the message is late.
      this.#ahead = time - (left !== null && this.#quiet !== null ? left : came);
      // A gateway without robots sends nothing else.
      if (this.views === null && this.store.robots.size === 0) this.views = [];
      if (this.store.robots.size === 0) this.isWhole = true;
    }
    if (sent.type === "reset" && sent.robot === null) this.isWhole = false;
    for (const change of this.store.apply(sent, now)) {
      switch (change.kind) {
        case "robot":
          if (change.slow) this.#refresh(change.name);
          break;
        case "removed":
          this.#refresh(change.name);
          break;
        case "ask":
          void this.#ask(change.name, change.ticket);
          break;
        case "event":
          if (change.event.event.startsWith("alarm_")) this.readAlarms();
          if (change.event.event === "stop_cleared") stops.cleared(change.event.robot, Date.parse(change.event.time));
          for (const read of this.#readers) read(change.event);
          break;
        case "events_lost":
          // What was missed is in the snapshots of a new connection, in the order of what follows.
          this.#link?.again();
          this.readAlarms();
          break;
      }
    }
    if (!this.isWhole && this.store.resume !== null && !this.store.isPassing) this.#settle();
    touch();
  }

  /** Makes the views of these robots anew, once for all messages of a moment. */
  #refresh(name: string): void {
    this.#dirty.add(name);
    this.#settle();
  }

  #settle(): void {
    if (this.#isScheduled) return;
    this.#isScheduled = true;
    setTimeout(() => {
      this.#isScheduled = false;
      const views = new Map((this.views ?? []).map((view) => [view.name, view]));
      for (const one of this.#dirty) {
        const robot = this.store.robots.get(one);
        if (robot === undefined) {
          views.delete(one);
        } else {
          const view = viewOf(robot);
          views.set(one, view);
          this.#standing.note(view, this.now());
        }
      }
      this.#dirty.clear();
      this.views = [...views.values()].sort((a, b) => (a.name < b.name ? -1 : 1));
      if (this.store.resume !== null && !this.store.isPassing) this.isWhole = true;
    }, 30);
  }

  /** Since when the arm of a robot is seen to stand while its program runs, on the page's clock. */
  standsSince(robot: string): number | null {
    return this.isThere ? this.#standing.since(robot) : null;
  }

  /** Asks what answers behind a name now, until that is known or asked for anew; some times at most. */
  async #ask(name: string, ticket: number): Promise<void> {
    const link = this.#link;
    for (let tries = 0; tries < TRIES; tries += 1) {
      if (link === null || link !== this.#link || !this.store.isAsked(name, ticket)) return;
      const answer = await call<RobotState>("GET", robotPath(name));
      if (link !== this.#link) return;
      if (answer.kind === "ok") {
        const isKnown = this.store.known(name, ticket, answer.value);
        if (isKnown !== null) this.#refresh(name);
        if (isKnown !== false) return;
      }
      await new Promise((next) => setTimeout(next, AGAIN));
      if (this.store.robots.get(name)?.summary.link === "down") return;
    }
  }

  /** Ages go on. A clock of the page that stood still while the computer slept would leave them as they were. */
  #age(): void {
    const apart = Date.now() - performance.now();
    const slept = apart - this.#apart;
    this.#apart = apart;
    if (Math.abs(slept) > SLEPT) {
      this.#late.forget();
      if (slept > 0) this.isAgeUnknown = true;
      this.#link?.slept(Math.max(0, slept));
    }
    touch();
  }

  async #measureOn(link: Link): Promise<void> {
    for (let count = 1; link === this.#link; count += 1) {
      // Beside stops it would wait for its turn.
      if (!stops.isBusy) await this.#measure(link);
      const isSoon = count < FIRST || this.#unanswered !== null;
      await new Promise((next) => setTimeout(next, isSoon ? SOONER : MEASURE));
    }
  }

  async #measure(link: Link): Promise<void> {
    const { sent, came, isAnswered, date } = await echo(ANSWER);
    if (link !== this.#link) return;
    const isInTime = isAnswered && came - sent <= ANSWER;
    this.latency = isInTime ? Math.round(came - sent) : null;
    this.#unanswered = isInTime || sent < this.#backAt ? null : sent;
    if (date !== null) this.#takeDate(sent, came, date);
    touch();
  }

  #takeDate(sent: number, came: number, date: number): void {
    this.#late.answered(sent, came, date);
    if (this.hasClock) return;
    // It has whole seconds: `alive` makes it exact.
    this.#ahead = date + 500 - (sent + came) / 2;
    this.hasClock = true;
  }
}

export const hall = new Hall();

goBy(() => new Date(hall.time(hall.now())));
goByClock(() => (hall.hasClock ? hall.time(hall.now()) : null));
