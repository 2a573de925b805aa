/** Which events are shown, and where they are asked for. Pure. */
import { robotPath } from "../../api/paths.ts";
export const KINDS: Record<string, string> = {
  main: "alarm_began,alarm_ended,mode_changed,program_changed,parts_reset,link_lost,link_back,unseen",
  alarms: "alarm_began,alarm_ended",
  links: "link_lost,link_back,unseen",
  cycles: "cycle_done,parts,parts_reset",
  all: "",
};

export const USUAL = "main";

/** The path of the events of a robot. Times are milliseconds since 1970. */
export function eventsPath(robot: string, from: number, to: number, kind: string): string {
  const of = KINDS[kind] ?? "";
  const query = new URLSearchParams({
    from: new Date(from).toISOString(),
    to: new Date(to).toISOString(),
    limit: "1000",
    ...(of === "" ? {} : { kind: of }),
  });
  return robotPath(robot, `history/events?${query}`);
}
