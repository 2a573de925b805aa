/** What is said of a stop. The words come from the page. */
import type { StopState } from "./stop.ts";

export interface Words {
  one(robot: string): string;
  not: string;
  dismiss: string;
  dismissOf(robot: string): string;
  waiting(robot: string): string;
  sending(robot: string): string;
  stopped(robot: string, at: string): string;
  notConfirmed(robot: string): string;
  notSent(robot: string): string;
  why(why: string): string;
}

export function say(robot: string, state: StopState, words: Words, clock: (at: Date) => string): string {
  switch (state.kind) {
    case "waiting":
      return words.waiting(robot);
    case "sending":
      return words.sending(robot);
    case "stopped":
      return words.stopped(robot, clock(state.at));
    case "not_confirmed":
      return `${words.notConfirmed(robot)} ${words.why(state.why)}`;
    case "not_sent":
      return `${words.notSent(robot)} ${words.why(state.why)}`;
  }
}

/** The same beside a button that has the name of the robot: without it. */
export function sayBeside(robot: string, state: StopState, words: Words, clock: (at: Date) => string): string {
  const text = say(robot, state, words, clock);
  return text.startsWith(robot) ? text.slice(robot.length).replace(/^(?:: |：)/, "") : text;
}

/** Whether it has to be read by somebody. */
export function isBad(state: StopState | null): boolean {
  return state !== null && (state.kind === "not_confirmed" || state.kind === "not_sent");
}
