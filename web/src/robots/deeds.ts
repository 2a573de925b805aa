/**
 * What was done to a robot through this gateway, as far as its events tell: who set the global speed, who
 * stopped it, which program was run. Pure: events come in, in their order.
 */
import type { GatewayEvent, RunEnd, RunState } from "../api/types.ts";

export interface SpeedSet {
  percent: number;
  /** Who held the lease; `null` if that is not known. */
  by: string | null;
  /** In milliseconds since 1970. */
  at: number;
  /** `unknown`: the controller may have taken it or not. */
  outcome: "accepted" | "unknown";
}

export interface StopDone {
  by: string;
  at: number;
  /** Whether it is proved that the arm stood; `null` while that is not known yet. */
  confirmed: boolean | null;
}

export interface RunSeen {
  id: number;
  /** `null` if its text was sent. */
  program: string | null;
  steps: number;
  accepted: number;
  done: number;
  at: number;
  ended: { state: RunState; because: RunEnd } | null;
}

export interface Deeds {
  /** The last global speed that was sent; `null` if none is known of. */
  speed: SpeedSet | null;
  /** The stop that holds: the first one since a stop was cleared. */
  stop: StopDone | null;
  run: RunSeen | null;
  holder: string | null;
  /** A speed on its way, by the number of its command. */
  sent: { id: number; percent: number; by: string | null } | null;
}

export const NO_DEEDS: Deeds = { speed: null, stop: null, run: null, holder: null, sent: null };

/**
 * The percent of a command as it is told, `modifyGSPD "300"`: percent times 10. `null` for another command.
 */
export function speedOf(command: string): number | null {
  const tenths = /^modifyGSPD "(\d+)"$/.exec(command)?.[1];
  return tenths === undefined ? null : Number(tenths) / 10;
}

export function afterEvent(before: Deeds, event: GatewayEvent): Deeds {
  const at = Date.parse(event.time);
  switch (event.event) {
    case "lease_began":
      return { ...before, holder: event.holder };
    case "lease_ended":
      return { ...before, holder: null };
    case "command_began": {
      const percent = speedOf(event.command);
      return percent === null ? before : { ...before, sent: { id: event.command_id, percent, by: before.holder } };
    }
    case "command_ended": {
      const { sent } = before;
      if (sent === null || sent.id !== event.command_id) return before;
      const isUnknown = event.outcome === "unknown";
      if (event.outcome !== "accepted" && !isUnknown) return { ...before, sent: null };
      const { percent, by } = sent;
      return { ...before, sent: null, speed: { percent, by, at, outcome: isUnknown ? "unknown" : "accepted" } };
    }
    case "stop_began":
      return before.stop !== null ? before : { ...before, stop: { by: event.by, at, confirmed: null } };
    case "stop_ended":
      // Of several stops, one that proved that the arm stands is enough.
      if (before.stop === null || before.stop.confirmed === true) return before;
      return { ...before, stop: { ...before.stop, confirmed: event.confirmed } };
    case "stop_cleared":
      return { ...before, stop: null };
    case "run_began": {
      const { run_id: id, program, steps } = event;
      return { ...before, run: { id, program, steps, accepted: 0, done: 0, at, ended: null } };
    }
    case "run_progress":
      if (before.run?.id !== event.run_id) return before;
      return { ...before, run: { ...before.run, accepted: event.accepted, done: event.done } };
    case "run_ended":
      if (before.run?.id !== event.run_id) return before;
      return { ...before, run: { ...before.run, done: event.done, ended: { state: event.state, because: event.because } } };
    case "identity_changed":
    case "identity_accepted":
    case "robot_changed":
    case "robot_removed":
      // What was done to another machine says nothing of this one. A stop holds for the name.
      return { ...NO_DEEDS, stop: before.stop };
    default:
      return before;
  }
}

/** The events of a stream of `GET /v1/events`, as far as it came. */
export function eventsOf(text: string): GatewayEvent[] {
  const parts = text.split(/\r?\n\r?\n/);
  // The last part has not come to its end, or is empty.
  return parts.slice(0, -1).flatMap((part): GatewayEvent[] => {
    if (!/^event: event$/m.test(part)) return [];
    const data = [...part.matchAll(/^data: ?(.*)$/gm)].map(([, line]) => line).join("\n");
    try {
      return [JSON.parse(data) as GatewayEvent];
    } catch {
      return [];
    }
  });
}
