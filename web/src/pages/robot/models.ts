/** What a robot has to be configured with to get a model: everything else stays as it is. */
import type { PollGroup, RobotWanted } from "../../api/types.ts";
import { extra } from "../../robots/extra.ts";

/** `read`: all addresses that the gateway reads of it, in their order. */
export function withModel(
  robot: { address: string; period: number; read: readonly string[]; groups: readonly PollGroup[] },
  model: string,
): RobotWanted {
  const read = extra(robot.read, robot.groups);
  return { address: robot.address, period_ms: robot.period, read, groups: [...robot.groups], model };
}
