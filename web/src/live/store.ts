/**
 * What is known of the robots: their summaries and their values. No Svelte and no clock: times are those of
 * the caller, in milliseconds that only grow.
 */
import type { AddressValue, GatewayEvent, LiveSent, PollGroup, RobotSummary, Signal, SignalQuality } from "../api/types.ts";
import type { Changed, Many } from "./pack.ts";

/** A value as it was received. */
export interface Value {
  value: AddressValue | null;
  unit: string | null;
  quality: SignalQuality;
  /** When the gateway asked for it, as far as is known; `null` without a value. */
  asked: number | null;
}

export interface Robot {
  summary: RobotSummary;
  /** How often its values are read, in milliseconds. */
  period: number;
  /** Values that are read with a period of their own. */
  groups: readonly PollGroup[];
  values: Map<string, Value>;
  /** When the link was lost, if it is lost and that is known. */
  downSince: number | null;
  /** Grows with each word on who answers: an answer to an earlier question does not count. */
  ticket: number;
}

/** How often a value is read, in milliseconds. */
export function periodOf(robot: Robot, address: string): number {
  const period = robot.groups.find((group) => group.read.includes(address))?.period_ms ?? robot.period;
  // The mode is read twice a second at least.
  return address === "curMode" ? Math.min(period, 500) : period;
}

export type Change =
  | { kind: "robot"; name: string; slow: boolean }
  | { kind: "removed"; name: string }
  /** Another robot may answer now: what it is has to be asked for, and `known` to be called with the answer. */
  | { kind: "ask"; name: string; ticket: number }
  | { kind: "event"; event: GatewayEvent }
  | { kind: "events_lost" };

/** Values that the tiles and the sentences are made of. The others are written to the page by frames. */
const SLOW = new Set(["curMode", "curAlarm", "isMoving", "origin", "RemoteCmdLen", "curMold"]);

/** Events after which another robot may answer. */
const ASKS = new Set<string>(["link_up", "identity_changed", "identity_accepted"]);

export class Store {
  private tickets = 0;
  readonly robots = new Map<string, Robot>();
  /** Robots from before a reset that no snapshot has told of yet. */
  private readonly unsure = new Set<string>();
  /** Where to go on after a lost connection. */
  resume: string | null = null;
  private isPass = true;

  /** Takes in a message. What changed is returned in order. */
  apply(sent: LiveSent | Many, now: number): Change[] {
    const changes = sent.type === "many" ? this.takeMany(sent.each(), now) : this.take(sent, now);
    if (typeof sent.resume === "string") this.resume = sent.resume;
    const isPassed = sent.type === "alive" && typeof sent.passed_ms_ago === "number";
    if (isPassed || typeof sent.resume === "string") {
      this.isPass = false;
      // The pass is at its end, so a robot without a snapshot is not there any more.
      for (const name of this.unsure) {
        this.robots.delete(name);
        changes.push({ kind: "removed", name });
      }
      this.unsure.clear();
    }
    return changes;
  }

  /** The connection is lost: what changes until all robots had their turn over the next one is not known. */
  lost(): void {
    this.isPass = true;
  }

  /** Forgets everything: another user may see other robots. */
  clear(): void {
    this.robots.clear();
    this.unsure.clear();
    this.resume = null;
    this.isPass = true;
  }

  /** Whether a pass over all robots is under way: what is known of them is of two times. */
  get isPassing(): boolean {
    return this.isPass;
  }

  private take(sent: LiveSent, now: number): Change[] {
    switch (sent.type) {
      case "snapshot": {
        const { signals, period_ms, groups = [], epoch: _epoch, number: _number, type: _type, ...summary } = sent;
        const values = new Map(signals.map((signal) => [signal.address, valueOf(signal, now)]));
        const downSince = summary.link === "down" ? lastAsked(values) : null;
        this.unsure.delete(summary.name);
        this.robots.set(summary.name, { summary, period: period_ms, groups, values, downSince, ticket: this.ticket() });
        return [{ kind: "robot", name: summary.name, slow: true }];
      }
      case "change": {
        const robot = this.robots.get(sent.robot);
        if (robot === undefined) return [];
        let slow = false;
        for (const signal of sent.signals) {
          slow = put(robot, signal.address, valueOf(signal, now)) || slow;
        }
        return [{ kind: "robot", name: sent.robot, slow }];
      }
      case "removed":
        this.unsure.delete(sent.robot);
        return this.robots.delete(sent.robot) ? [{ kind: "removed", name: sent.robot }] : [];
      case "reset":
        this.isPass ||= sent.robot === null;
        if (sent.robot === null) for (const name of this.robots.keys()) this.unsure.add(name);
        return [];
      case "event": {
        const changes: Change[] = [{ kind: "event", event: sent }];
        if (this.happened(sent, now)) changes.push({ kind: "robot", name: sent.robot, slow: true });
        const robot = this.robots.get(sent.robot);
        if (robot !== undefined && ASKS.has(sent.event)) {
          changes.push({ kind: "ask", name: sent.robot, ticket: robot.ticket });
        }
        return changes;
      }
      case "events_lost":
        return [{ kind: "events_lost" }];
      case "alive":
      case "subscribed":
      case "problem":
        return [];
    }
  }

  private takeMany(changed: Iterable<Changed>, now: number): Change[] {
    const slow = new Map<string, boolean>();
    for (const { robot: name, address, value, unit, quality, age } of changed) {
      const robot = this.robots.get(name);
      if (robot === undefined) continue;
      const isSlow = put(robot, address, { value, unit, quality, asked: age === null ? null : now - age });
      if (isSlow || !slow.has(name)) slow.set(name, isSlow);
    }
    return Array.from(slow, ([name, isSlow]) => ({ kind: "robot", name, slow: isSlow }));
  }

  /** Parts of a summary that have no numbers are told by events alone. Returns whether one changed. */
  private happened(event: GatewayEvent, now: number): boolean {
    const robot = this.robots.get(event.robot);
    if (robot === undefined) return false;
    const set = (part: Partial<RobotSummary>): boolean => {
      robot.summary = { ...robot.summary, ...part };
      return true;
    };
    const { stops_under_way: stops, lease } = robot.summary;
    // Events do not tell whether it is a virtual one. Until that was asked for, it is not known.
    if (ASKS.has(event.event)) robot.ticket = this.ticket();
    switch (event.event) {
      case "link_up":
        robot.downSince = null;
        return set({ link: "up", virtual: null, identity: null });
      case "link_down":
        robot.downSince ??= now;
        return set({ link: "down" });
      case "identity_changed":
        return set({
          identity_changed: { expected: event.expected, found: event.found },
          lease: null,
          virtual: null,
          identity: null,
        });
      case "identity_accepted":
        return set({ identity: event.identity, identity_changed: null, virtual: null });
      case "lease_began":
        return set({ lease: { number: event.lease, holder: event.holder, expires_in_ms: 0 } });
      case "lease_ended":
        // A later lease may have begun already.
        return lease !== null && lease.number > event.lease ? false : set({ lease: null });
      case "stop_began": {
        if (!event.holds) return set({ stops_under_way: stops + 1 });
        // Of several stops that hold together, the first is named.
        const by = robot.summary.stopped_by ?? { by: event.by, at: event.time };
        // A gateway that tells no numbers cannot be asked to clear the stops up to one.
        const stop_number = event.number || robot.summary.stop_number;
        return set({ stopped: true, stopped_by: by, stops_under_way: stops + 1, stop_number });
      }
      case "stop_ended":
        return set({ stops_under_way: Math.max(0, stops - 1) });
      case "stop_cleared":
        return set({ stopped: false, stopped_by: null });
      case "global_speed":
        return set({ global_speed: event.set });
      default:
        return false;
    }
  }

  /**
   * Takes in what `GET /v1/robots/{name}` says of who answers. Returns whether that is known now; `null` if the
   * question is void: something else was told meanwhile.
   */
  known(name: string, ticket: number, summary: RobotSummary): boolean | null {
    const robot = this.robots.get(name);
    if (robot === undefined || robot.ticket !== ticket) return null;
    const { virtual, identity, identity_changed } = summary;
    robot.summary = { ...robot.summary, virtual, identity, identity_changed };
    return virtual !== null;
  }

  /** Whether an answer to this question still counts. */
  isAsked(name: string, ticket: number): boolean {
    return this.robots.get(name)?.ticket === ticket;
  }

  private ticket(): number {
    return (this.tickets += 1);
  }
}

/** Takes in a value. Returns whether tiles and sentences are made of it. */
function put(robot: Robot, address: string, value: Value): boolean {
  const before = robot.values.get(address);
  robot.values.set(address, value);
  return SLOW.has(address) || before?.quality !== value.quality || address.startsWith("counter-");
}

function valueOf(signal: Signal, now: number): Value {
  const asked = signal.age_ms === null ? null : now - signal.age_ms;
  return { value: signal.value, unit: signal.unit, quality: signal.quality, asked };
}

function lastAsked(values: Map<string, Value>): number | null {
  let last: number | null = null;
  for (const { asked } of values.values()) if (asked !== null && (last === null || asked > last)) last = asked;
  return last;
}
