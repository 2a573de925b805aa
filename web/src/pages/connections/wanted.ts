/** A robot that somebody adds or changes, as it is typed. */
import type { PollGroup, RobotSummary, RobotWanted } from "../../api/types.ts";
import { kept } from "../../robots/kept.ts";

export interface Typed {
  address: string;
  period: string;
  read: string;
  model: string;
}

export function isRobotName(text: string): boolean {
  return /^[a-z0-9-]{1,32}$/.test(text);
}

export function isPeriod(text: string): boolean {
  const number = Number(text);
  return /^\d{2,7}$/.test(text) && number >= 20 && number <= 3_600_000;
}

/** A change of a robot: as it was typed, with what cannot be typed as it is. */
export function changeOf(typed: Typed, robot: Pick<RobotSummary, "parts" | "guard">, groups: readonly PollGroup[]): RobotWanted {
  return { ...wantedOf(typed), groups: [...groups], ...kept(robot) };
}

export function wantedOf({ address, period, read, model }: Typed): RobotWanted {
  const addresses = read.split(/[\s,]+/).filter((one) => one !== "");
  return {
    address: address.trim(),
    period_ms: Number(period),
    read: addresses,
    ...(model.trim() === "" ? {} : { model: model.trim() }),
  };
}
