/** What a robot has to be configured with to get a model: everything else stays as it is. */
import type { PollGroup, RobotWanted } from "../../api/types.ts";

/** What the gateway reads of every robot. */
const USUAL =
  /^(curMode|curAlarm|isMoving|origin|RemoteCmdLen|curMold|curCycle|lastCycle|axis-[0-5]|world-[0-5])$/;

/** `read`: all addresses that the gateway reads of it, in their order. */
export function withModel(
  robot: { address: string; period: number; read: readonly string[]; groups: readonly PollGroup[] },
  model: string,
): RobotWanted {
  const grouped = new Set(robot.groups.flatMap((group) => group.read));
  const read = robot.read.filter((address) => !USUAL.test(address) && !grouped.has(address));
  return { address: robot.address, period_ms: robot.period, read, groups: [...robot.groups], model };
}
