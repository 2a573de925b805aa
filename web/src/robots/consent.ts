/** What a person was told before a start, and whether that still holds. */
import type { View } from "./view.ts";

export interface Consent {
  /** The name of the robot. */
  name: string;
  program: string | null;
  /** Instructions left in the list; `null` if that was not known. */
  left: number | null;
  virtual: boolean | null;
  /** Which machine it was, as one text. */
  machine: string;
  /** The global speed in percent: as its panel says, or as it was set last; `null` if it is not known. */
  speed: number | null;
}

/** The machine that answers behind a name, as one text: another one for another machine of the same name. */
export function machineOf({ summary: { identity, identity_changed, virtual }, who }: View): string {
  return JSON.stringify([who, identity, identity_changed, virtual]);
}

export type Changed = "robot" | "program" | "left" | "speed";

/** `ofPanel`: the global speed that the panel of a virtual robot says; `null` without one. */
export function consentOf(view: View, ofPanel: number | null = null): Consent {
  const speed = ofPanel ?? view.summary.global_speed?.percent ?? null;
  return { name: view.name, program: view.program, left: view.left, virtual: view.summary.virtual, machine: machineOf(view), speed };
}

/** What is not any more as the person was told. */
export function changed(consent: Consent, view: View, ofPanel: number | null = null): Changed | null {
  const now = consentOf(view, ofPanel);
  if (now.name !== consent.name || now.machine !== consent.machine || now.virtual !== consent.virtual) return "robot";
  if (now.program !== consent.program) return "program";
  // To an empty list nothing was added with this consent: the gateway refuses if there is something.
  if (now.left !== consent.left && !(consent.left === 0 && now.left === null)) return "left";
  if (now.speed !== consent.speed) return "speed";
  return null;
}

/** Whether what is left in the list may run too: only if the person was told so. */
export function mayRunLeftover(consent: Consent): boolean {
  return consent.left !== 0;
}
