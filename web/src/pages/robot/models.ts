/** What a robot has to be configured with to get a model: everything else stays as it is. */
import type { RobotWanted } from "../../api/types.ts";

/** What the gateway reads of every robot. */
const USUAL =
  /^(curMode|curAlarm|isMoving|origin|RemoteCmdLen|curMold|curCycle|lastCycle|axis-[0-5]|world-[0-5])$/;

/** `read`: all addresses that the gateway reads of it, in their order. */
export function withModel(
  robot: { address: string; period: number; read: readonly string[] },
  model: string,
): RobotWanted {
  const read = robot.read.filter((address) => !USUAL.test(address));
  return { address: robot.address, period_ms: robot.period, read, model };
}
