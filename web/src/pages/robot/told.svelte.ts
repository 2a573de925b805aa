/** What became of the last request for each robot: it is shown on the page of that robot alone. */
import { SvelteMap } from "svelte/reactivity";
import type { Answer } from "../../api/client.ts";
import type { en } from "../../i18n/en.ts";

/** The part of the page where a person acted: the outcome is said there, and nowhere else. */
export type Part = "top" | "control" | "alarms" | "arm" | "io" | "numbers" | "panel";

export interface Said {
  text: string;
  isBad: boolean;
  part: Part;
}

class Told {
  #said = new SvelteMap<string, Said>();

  of(robot: string): Said | null {
    return this.#said.get(robot) ?? null;
  }

  clear(robot: string): void {
    this.#said.delete(robot);
  }

  say(robot: string, text: string, part: Part, isBad = false): void {
    this.#said.set(robot, { text, isBad, part });
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
    if (isUnknown) this.say(robot, words.control.unknown(what), part, true);
    else this.say(robot, words.control.refused(what, answer.problem.message), part, true);
  }
}

export const told = new Told();
