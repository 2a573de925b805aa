/** Asks the panel of a virtual robot again and again how fast it is set: no address of the controller tells that. */
import { call } from "../../api/client.ts";
import { robotPath } from "../../api/paths.ts";
import type { PanelState } from "../../api/types.ts";
import { hall } from "../../state/hall.svelte.ts";
import { session } from "../../state/session.svelte.ts";
import { OLD, panelSpeeds } from "../robot/panel.ts";

/** How often, in milliseconds: before what it said is old. */
const EVERY = 1_000;

export class PanelSpeed {
  /** In percent; `null` if the robot has no panel, or if it said nothing lately. */
  percent = $state<number | null>(null);

  /** Follows the panel of this robot until it is ended. */
  follow(robot: string): () => void {
    let isOver = false;
    let timer: ReturnType<typeof setTimeout>;
    const ask = async (): Promise<void> => {
      if (session.isUsed && document.visibilityState === "visible" && hall.isThere) {
        const at = hall.now();
        const answer = await call<PanelState>("GET", robotPath(robot, "panel"), { patience: OLD });
        if (isOver) return;
        if (answer.kind === "ok") panelSpeeds.say(robot, answer.value.global_speed_percent, at);
      }
      this.percent = panelSpeeds.of(robot, hall.now());
      timer = setTimeout(() => void ask(), EVERY);
    };
    void ask();
    return () => {
      isOver = true;
      clearTimeout(timer);
      this.percent = null;
    };
  }
}
