/** Alarms as lists, and what a person does to them: one request each, which is never sent again. */
import { type Answer, call } from "../api/client.ts";
import { type Failure, failureOf } from "../api/failure.ts";
import { robotPath } from "../api/paths.ts";
import type { RobotAlarm, RobotAlarms } from "../api/types.ts";
import type { Told } from "./act.svelte.ts";
import { hall } from "./hall.svelte.ts";
import { session } from "./session.svelte.ts";
import { settings } from "./settings.svelte.ts";

/** How long a question that failed waits to be asked again, in milliseconds. */
const AGAIN = 5_000;

/**
 * The alarms of a path, read again when one begins, ends, or is acknowledged or shelved. Make it while a component is
 * made: it reads for as long as that is there.
 */
export class ReadAlarms {
  /** `null` before the first answer. It stays when a later question fails. */
  known = $state.raw<RobotAlarms | null>(null);
  /** Why the last question had no answer; `null` if it had one. */
  failure = $state.raw<Failure | null>(null);
  #attempt = $state(0);

  constructor(path: () => string) {
    // A robot's values change all the time, and its path does not.
    const where = $derived(path());
    $effect(() => {
      void hall.alarms;
      void this.#attempt;
      let isOver = false;
      let timer: ReturnType<typeof setTimeout>;
      void call<RobotAlarms>("GET", where).then((answer) => {
        if (isOver) return;
        this.failure = failureOf(answer);
        if (answer.kind === "ok") this.known = answer.value;
        else timer = setTimeout(() => this.again(), AGAIN);
      });
      return () => {
        isOver = true;
        clearTimeout(timer);
      };
    });
  }

  again(): void {
    this.#attempt += 1;
  }
}

class Acts {
  told = $state.raw<Told | null>(null);
  isBusy = $state(false);

  /** Acknowledges these, one after the other, up to the first that fails. */
  async acknowledge(alarms: RobotAlarm[]): Promise<void> {
    const words = settings.words.alarms;
    const open = alarms.filter((alarm) => alarm.acknowledged === null);
    this.isBusy = true;
    for (const [at, alarm] of open.entries()) {
      const what = words.acknowledgeOf(words.what(alarm.robot, alarm.code));
      const isDone = this.#say(what, await this.#send("POST", alarm, "acknowledge", {}));
      if (!isDone) break;
      if (open.length > 1) this.told = { text: words.acknowledging(at + 1, open.length), state: "done" };
    }
    this.#end();
  }

  /** Returns whether it is shelved. */
  async shelve(alarm: RobotAlarm, forMs: number, reason: string): Promise<boolean> {
    const words = settings.words.alarms;
    this.isBusy = true;
    const what = words.shelveOf(words.what(alarm.robot, alarm.code));
    const isDone = this.#say(what, await this.#send("POST", alarm, "shelve", { for_ms: forMs, reason }));
    this.#end();
    return isDone;
  }

  async unshelve(alarm: RobotAlarm): Promise<void> {
    const words = settings.words.alarms;
    this.isBusy = true;
    this.#say(words.unshelveOf(words.what(alarm.robot, alarm.code)), await this.#send("DELETE", alarm, "shelve"));
    this.#end();
  }

  async #send(method: "POST" | "DELETE", { robot, id }: RobotAlarm, what: string, body?: object): Promise<Answer<RobotAlarm>> {
    const path = robotPath(robot, `alarms/${id}/${what}`);
    return call<RobotAlarm>(method, path, { csrf: session.csrf, ...(body === undefined ? {} : { body }) });
  }

  #say(what: string, answer: Answer<unknown>): boolean {
    const words = settings.words.alarms;
    if (answer.kind === "ok") this.told = { text: words.done(what), state: "done" };
    else if (answer.kind === "unknown" || answer.status === 504) this.told = { text: words.outcomeUnknown(what), state: "bad" };
    else {
      const why = settings.words.ui.refusal(answer.problem, false);
      this.told = { text: words.refused(what, why), state: "bad", said: answer.problem };
    }
    return answer.kind === "ok";
  }

  #end(): void {
    this.isBusy = false;
    hall.readAlarms();
  }
}

export const acts = new Acts();
