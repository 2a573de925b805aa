/** What became of a run, in words. */
import type { en } from "../../i18n/en.ts";
import { type Sent, isUnsent, mayRun } from "../../run/sent.ts";
import { machineOf } from "../../robots/consent.ts";
import { type View, isRunning, isSeen } from "../../robots/view.ts";
import type { Told } from "../../state/act.svelte.ts";

/**
 * Whether what ran last on a robot came to its end, and is another program than the one of the page. `ran`: what this page
 * called it; `null` if another page sent it. `name`: the program of the page, if it has one.
 */
export function isOfOther(sent: Sent | null, ran: string | null, name: string | undefined): boolean {
  return sent?.kind === "ended" && sent.run.state === "done" && ran !== null && name !== undefined && ran !== name;
}

/** `time`: a time of the gateway as a time of day of the hall. */
export function outcomeOf(sent: Sent | null, robot: string, words: typeof en, time: (at: string) => string): Told | null {
  const own = words.run;
  const good = (text: string): Told => ({ text, state: "done" });
  const bad = (text: string): Told => ({ text, state: "bad" });
  switch (sent?.kind) {
    case undefined:
      return null;
    case "sent":
      return { text: own.sent(robot), state: "under_way" };
    case "accepted":
      return { text: own.accepted(robot, sent.run.accepted, sent.run.done, sent.run.steps), state: "under_way" };
    case "unheard":
      return bad(own.unheard(robot, sent.run.done, sent.run.steps));
    case "refused":
      return { ...bad(own.refused(words.ui.refusal(sent.failure))), said: sent.failure };
    case "list_refused":
      return { ...bad(own.listRefused(words.ui.refusal(sent.failure))), said: sent.failure };
    case "unknown":
      return bad(own.unknown(robot));
    case "ended": {
      const { state, because, proof, stopped_by: by } = sent.run;
      const why = own.because(because);
      if (state === "done") return good(own.done(robot, own.proof[proof ?? ""] ?? ""));
      if (state === "stopped") return bad(by === null ? own.stopped(why) : own.stoppedBy(by.by, time(by.at)));
      if (state === "failed") return bad(own.failed(why));
      if (state === "refused") return bad(own.notCarried(why));
      return bad(own.unknownEnd(why));
    }
  }
}

/**
 * The program of the controller that ran before the run and is seen not to run after it; `null` if that is not seen.
 * `name` is `null` if the controller does not tell it.
 */
export function ceased(sent: Sent | null, before: View | null, now: View): { name: string | null } | null {
  if (sent === null || before === null || mayRun(sent) || isUnsent(sent)) return null;
  if (!isRunning(before) || !isSeen(now) || isRunning(now) || machineOf(before) !== machineOf(now)) return null;
  return { name: before.program };
}
