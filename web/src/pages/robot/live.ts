/** Values of one robot as texts, with their ages. */
import type { AddressValue } from "../../api/types.ts";
import { DEAD, type Shown, shown } from "../../live/age.ts";
import { periodOf } from "../../live/store.ts";
import { plain } from "../../i18n/plain.ts";
import { hall } from "../../state/hall.svelte.ts";
import { settings } from "../../state/settings.svelte.ts";

/** Decimals of positions. */
export const DECIMALS = 3;

export function stateOf(robot: string, address: string): Shown {
  const known = hall.store.robots.get(robot);
  return shown(known?.values.get(address), hall.now(), hall.since, known ? periodOf(known, address) : Infinity);
}

/** The value; `-` if it is too old to be shown. */
export function valueText(robot: string, address: string, decimals?: number): string {
  const value = hall.store.robots.get(robot)?.values.get(address);
  if (value === undefined || value.value === null || stateOf(robot, address).kind === "dead") return "-";
  return textOf(value.value, decimals);
}

export function ageText(robot: string, address: string): string {
  const state = stateOf(robot, address);
  const { words } = settings;
  if (state.kind === "fresh") return words.robot.now;
  if (state.kind === "slow") return words.robot.upTo(state.age / 1000);
  return state.age === null ? "-" : words.robots.old(state.age / 1000);
}

/** Whether a value was read and is old. What was never read is `-`, and not old. */
export function isOld(robot: string, address: string): boolean {
  const state = stateOf(robot, address);
  if (state.kind === "slow") return state.age > DEAD;
  return state.kind !== "fresh" && state.age !== null;
}

export function textOf(value: AddressValue, decimals?: number): string {
  const { words } = settings;
  if (typeof value === "number") return decimals === undefined ? String(value) : value.toFixed(decimals);
  if (typeof value === "boolean") return value ? words.robot.yes : words.robot.no;
  if (typeof value === "string") return plain(value);
  if (Array.isArray(value)) return value.join(", ");
  return `${value.current} / ${value.target}`;
}
