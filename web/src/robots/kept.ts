/** What a change of a robot has to send along: a change takes away what it leaves out, the limits of the lists too. */
import type { RobotSummary, RobotWanted } from "../api/types.ts";

/** The counter of parts that counts now, and the limits. */
export function kept({ parts, guard }: Pick<RobotSummary, "parts" | "guard">): Pick<RobotWanted, "parts" | "guard"> {
  const wanted: Pick<RobotWanted, "parts" | "guard"> = {};
  if (parts !== null) wanted.parts = parts;
  if (guard !== null) {
    const { max_speed, max_path_speed, max_axis_step, max_distance, axes, workspace } = guard;
    wanted.guard = { max_speed, max_path_speed, max_axis_step, max_distance, axes, workspace };
  }
  return wanted;
}
