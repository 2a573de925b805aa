/** What became of a run, in words. */
import type { en } from "../../i18n/en.ts";
import type { Sent } from "../../run/sent.ts";
import type { Told } from "../../state/act.svelte.ts";

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
