/** What is said of a stop. The words come from the page. */
import type { StopState } from "./stop.ts";

export interface Words {
  one(robot: string): string;
  not: string;
  dismiss: string;
  dismissOf(robot: string): string;
  /** A sentence with the robot that it is of. */
  of(robot: string, text: string): string;
  waiting: string;
  sending: string;
  stopped(at: string): string;
  notConfirmed: string;
  notSent: string;
  why(why: string): string;
}

/** Beside a button that has the name of the robot. */
export function sayBeside(state: StopState, words: Words, clock: (at: Date) => string): string {
  switch (state.kind) {
    case "waiting":
      return words.waiting;
    case "sending":
      return words.sending;
    case "stopped":
      return words.stopped(clock(state.at));
    case "not_confirmed":
      return `${words.notConfirmed} ${words.why(state.why)}`;
    case "not_sent":
      return `${words.notSent} ${words.why(state.why)}`;
  }
}

export function say(robot: string, state: StopState, words: Words, clock: (at: Date) => string): string {
  return words.of(robot, sayBeside(state, words, clock));
}

/** Whether it has to be read by somebody. */
export function isBad(state: StopState | null): boolean {
  return state !== null && (state.kind === "not_confirmed" || state.kind === "not_sent");
}
