/** What a robot has to be configured with to get a model: everything else stays as it is. */
import type { PollGroup, RobotSummary, RobotWanted } from "../../api/types.ts";
import { extra } from "../../robots/extra.ts";
import { kept } from "../../robots/kept.ts";

/** A robot as the page has it. `read`: all addresses that the gateway reads of it, in their order. */
export interface Configured extends Pick<RobotSummary, "address" | "parts" | "guard"> {
  period: number;
  read: readonly string[];
  groups: readonly PollGroup[];
}

export function withModel(robot: Configured, model: string): RobotWanted {
  const read = extra(robot.read, robot.groups);
  return { address: robot.address, period_ms: robot.period, read, groups: [...robot.groups], model, ...kept(robot) };
}
