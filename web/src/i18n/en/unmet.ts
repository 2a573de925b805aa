/** Why something cannot be done now. */
import type { Unmet } from "../../robots/sentence.ts";

export const UNMET: Record<Unmet, string> = {
  gateway_lost: "the gateway is not heard, or too late",
  no_right: "this needs the role operator",
  no_link: "no link to the robot",
  other_robot: "another robot answers: an engineer has to accept it",
  no_lease: "take control first",
  stale: "its state is old",
  unanswered: "the gateway waits for an answer of the robot: try again in a moment",
  manual: "manual mode: the pendant leads",
  mode_stop: "turn its key to automatic first, at the pendant",
  alarm: "clear the alarm first",
  no_alarm: "there is no alarm",
  stop_holds: "clear the stop first",
  no_stop: "no stop holds",
  running: "it runs already",
  not_running: "it does not run",
};
