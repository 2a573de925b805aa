/** A robot that somebody adds or changes, as it is typed. */
import type { RobotWanted } from "../../api/types.ts";

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

export function wantedOf({ address, period, read, model }: Typed): RobotWanted {
  const addresses = read.split(/[\s,]+/).filter((one) => one !== "");
  return {
    address: address.trim(),
    period_ms: Number(period),
    read: addresses,
    ...(model.trim() === "" ? {} : { model: model.trim() }),
  };
}
