/**
 * What events alone tell of a robot: which program was run, and whether a stop was proved. Who stopped it and who
 * set its speed, the gateway says with the robot. Pure: events come in, in their order.
 */
import type { GatewayEvent, RunEnd, RunState } from "../api/types.ts";

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
  /** Whether a stop proved that the arm stood, since a stop was cleared; `null` if that is not known yet. */
  proved: boolean | null;
  run: RunSeen | null;
}

export const NO_DEEDS: Deeds = { proved: null, run: null };

export function afterEvent(before: Deeds, event: GatewayEvent): Deeds {
  const at = Date.parse(event.time);
  switch (event.event) {
    case "stop_ended":
      // One stop that proves it is enough.
      return before.proved === true ? before : { ...before, proved: event.confirmed };
    case "stop_cleared":
      return { ...before, proved: null };
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
      // A run on another machine says nothing of this one. A stop holds for the name.
      return { ...NO_DEEDS, proved: before.proved };
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
