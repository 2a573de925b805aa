/** What became of the last request of the robot page. */
import type { Answer } from "../../api/client.ts";
import type { en } from "../../i18n/en.ts";

class Told {
  text = $state("");
  isBad = $state(false);

  clear(): void {
    this.say("");
  }

  say(text: string, isBad = false): void {
    this.text = text;
    this.isBad = isBad;
  }

  /** Says why a request was not carried out, or that the outcome is not known. */
  answer(what: string, answer: Exclude<Answer<unknown>, { kind: "ok" }>, words: typeof en): void {
    const isUnknown = answer.kind === "unknown" || answer.problem.code === "outcome_unknown" || answer.status === 504;
    if (isUnknown) this.say(words.control.unknown(what), true);
    else this.say(words.control.refused(what, answer.problem.message), true);
  }
}

export const told = new Told();
