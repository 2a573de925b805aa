/** What a person does to alarms: one request each, which is never sent again. */
import { type Answer, call } from "../api/client.ts";
import { robotPath } from "../api/paths.ts";
import type { RobotAlarm } from "../api/types.ts";
import type { Told } from "./act.svelte.ts";
import { hall } from "./hall.svelte.ts";
import { session } from "./session.svelte.ts";
import { settings } from "./settings.svelte.ts";

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
    else this.told = { text: words.refused(what, answer.problem.message), state: "bad" };
    return answer.kind === "ok";
  }

  #end(): void {
    this.isBusy = false;
    hall.readAlarms();
  }
}

export const acts = new Acts();
