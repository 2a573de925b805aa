/** A robot at rest whose state is known, for unit tests. */
import type { RobotSummary } from "../src/api/types.ts";
import type { View } from "../src/robots/view.ts";

export function viewLike(name: string, part: Partial<View> = {}, summary: Partial<RobotSummary> = {}): View {
  const whole: RobotSummary = {
    name,
    address: "",
    managed_by: "file",
    model: null,
    guard: null,
    parts: null,
    link: "up",
    identity: null,
    identity_changed: null,
    virtual: null,
    panel: false,
    twin: null,
    twin_of: null,
    owner: null,
    lease: null,
    stopped: false,
    stopped_by: null,
    stops_under_way: 0,
    stop_number: 0,
    global_speed: null,
    ...summary,
  };
  const rest = { mode: 2, alarm: 0, moving: false, homed: true, left: 0, program: null, parts: null, downSince: null, who: 1 };
  return { name, summary: whole, quality: "fresh", ...rest, ...part };
}
