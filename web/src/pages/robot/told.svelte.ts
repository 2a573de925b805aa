/** What became of the last request for each robot: it is shown on the page of that robot alone. */
import { SvelteMap } from "svelte/reactivity";
import type { Answer } from "../../api/client.ts";
import type { Failure } from "../../api/failure.ts";
import type { en } from "../../i18n/en.ts";
import { MODES, type View, isSeen } from "../../robots/view.ts";
import type { Told } from "../../state/act.svelte.ts";
import { hall } from "../../state/hall.svelte.ts";

/** The part of the page where a person acted: the outcome is said there, and nowhere else. */
export type Part = "top" | "control" | "alarms" | "arm" | "io" | "numbers" | "panel";

/** Whether the pendant leads: then the robot takes nothing, and answers all the same. */
function leads(view: View | undefined): boolean {
  return view !== undefined && isSeen(view) && (view.mode === MODES.manual || view.mode === MODES.step);
}

class ToldOfRobots {
  #told = new SvelteMap<string, Told & { part: Part }>();

  /** What is to be said in a part of the page of a robot. */
  at(robot: string, part: Part): Told | null {
    const told = this.#told.get(robot);
    return told?.part === part ? told : null;
  }

  clear(robot: string): void {
    this.#told.delete(robot);
  }

  /** `said`: the refusal that the text tells of. */
  say(robot: string, text: string, part: Part, isBad = false, said?: Failure): void {
    this.#told.set(robot, { text, part, state: isBad ? "bad" : "done", ...(said === undefined ? {} : { said }) });
  }

  /** Says why a request was not carried out, or that the outcome is not known. */
  answer(
    robot: string,
    what: string,
    answer: Exclude<Answer<unknown>, { kind: "ok" }>,
    words: typeof en,
    part: Part,
  ): void {
    const isUnknown = answer.kind === "unknown" || answer.problem.code === "outcome_unknown" || answer.status === 504;
    if (isUnknown) {
      this.say(robot, words.control.unknown(what), part, true);
    } else if (answer.problem.code === "not_ready" && !leads(hall.view(robot))) {
      const view = hall.view(robot);
      const isSilent = view !== undefined && !isSeen(view);
      const text = words.control.notReady(what, isSilent, words.ui.refusal(answer.problem, false));
      this.say(robot, text, part, true, answer.problem);
    } else {
      const why = words.ui.refusal(answer.problem, false);
      this.say(robot, words.control.refused(what, why), part, true, answer.problem);
    }
  }
}

export const told = new ToldOfRobots();
