/** What is seen now of a robot that a program is to run on. */
import { call } from "../../api/client.ts";
import { robotPath } from "../../api/paths.ts";
import type { Queried } from "../../api/types.ts";
import { consentOf } from "../../robots/consent.ts";
import { type View, isSeen } from "../../robots/view.ts";
import type { Agreed, Ready } from "../../run/guard.ts";
import { hall } from "../../state/hall.svelte.ts";
import { lease } from "../../state/lease.svelte.ts";
import { session } from "../../state/session.svelte.ts";
import { stops } from "../../stop/stops.ts";
import { stateOf } from "../robot/live.ts";

/** Where the axes of a robot stand; `null` if that is not known now. */
export function axesOf(view: View | undefined): number[] | null {
  const robot = view === undefined ? undefined : hall.store.robots.get(view.name);
  if (view === undefined || robot === undefined || !hall.isThere || view.summary.link !== "up") return null;
  const axes: number[] = [];
  let gap = false;
  for (let at = 0; at < 8; at += 1) {
    const address = `axis-${at}`;
    const read = robot.values.get(address);
    if (read === undefined || read.value === null) {
      // The arm has no more axes, or this one was not read.
      gap = true;
      continue;
    }
    if (gap) return null;
    if (typeof read.value !== "number" || stateOf(view.name, address).kind !== "fresh") return null;
    axes.push(read.value);
  }
  return axes.length > 0 ? axes : null;
}

/** The global speed that was set last over the gateway, in percent; `null` if it is not known. */
export function setSpeedOf(view: View): number | null {
  return view.summary.global_speed?.percent ?? null;
}

/**
 * Tool and work frame in use, as one text; `null` if the robot does not tell them; `undefined` without an
 * answer of now. `signal` gives the question up.
 */
export async function framesOf(robot: string, signal?: AbortSignal): Promise<string | null | undefined> {
  const path = robotPath(robot, `query?address=toolCoord`);
  const answer = await call<Queried>("GET", path, signal === undefined ? {} : { signal });
  if (answer.kind !== "ok") return undefined;
  const told = answer.value.signals.find(({ address }) => address === "toolCoord");
  if (told === undefined || told.value === null) return null;
  return told.quality === "fresh" ? JSON.stringify(told.value) : undefined;
}

/** What a person agrees to with the robot as it is now. */
export function agreedOf(view: View): Agreed {
  const { stopped, stops_under_way } = view.summary;
  // The gateway may not have heard of it yet, and a run could overtake it on another connection.
  const own = stops.of(view.name)?.kind;
  const isOnItsWay = own === "waiting" || own === "sending";
  return {
    lease: lease.robot === view.name ? lease.number : null,
    isStopped: stopped || stops_under_way > 0 || isOnItsWay,
    isFresh: isSeen(view),
    view,
    consent: consentOf(view),
  };
}

/** What the guard asks of the robot and of this page, and what its controller tells at all. */
export function accessTo(view: View): Pick<Ready, "view" | "gateway" | "right" | "lease" | "tells"> {
  const values = hall.store.robots.get(view.name)?.values;
  const tells = (address: string): boolean => (values?.get(address)?.quality ?? "none") !== "none";
  return {
    view,
    gateway: hall.isThere,
    right: session.may(view.name),
    lease: lease.robot === view.name,
    tells: { moving: tells("isMoving"), list: tells("RemoteCmdLen") },
  };
}
