/** What became of a run, in words. */
import type { en } from "../../i18n/en.ts";
import type { Sent } from "../../run/sent.ts";

export interface Outcome {
  text: string;
  isBad: boolean;
}

/** `time`: a time of the gateway as a time of day of the hall. */
export function outcomeOf(sent: Sent | null, robot: string, words: typeof en, time: (at: string) => string): Outcome {
  const own = words.run;
  const good = (text: string): Outcome => ({ text, isBad: false });
  const bad = (text: string): Outcome => ({ text, isBad: true });
  switch (sent?.kind) {
    case undefined:
      return good("");
    case "sent":
      return good(own.sent(robot));
    case "accepted":
      return good(own.accepted(robot, sent.run.accepted, sent.run.done, sent.run.steps));
    case "unheard":
      return bad(own.unheard(robot, sent.run.done, sent.run.steps));
    case "refused":
      return bad(own.refused(sent.message));
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
