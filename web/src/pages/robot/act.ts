/**
 * What a person does at a robot: one request, never sent again. What became of it is said on its page.
 *
 * 1. `Controls.svelte` asks `robots/sentence.ts` what is missing; what moves has its own step first (`ui/Hold.svelte`,
 *    `robots/consent.ts`).
 * 2. `command` here adds the lease of this page (`state/lease.svelte.ts`), `api/client.ts` sends it at once.
 * 3. The gateway reads it in `http/commands.rs`; its walk goes on in `r6-gateway/src/lib.rs`.
 * 4. `told.svelte.ts` says what the answer means. Whether the arm moves is told by the stream (`live/store.ts`).
 */
import { type Answer, call } from "../../api/client.ts";
import { robotPath } from "../../api/paths.ts";
import type { CommandDone } from "../../api/types.ts";
import { type Control, unmet } from "../../robots/sentence.ts";
import type { View } from "../../robots/view.ts";
import { hall } from "../../state/hall.svelte.ts";
import { lease } from "../../state/lease.svelte.ts";
import { session } from "../../state/session.svelte.ts";
import { settings } from "../../state/settings.svelte.ts";
import { type Part, told } from "./told.svelte.ts";

/** What this page has that controls of the robot need. */
export function hasFor(view: View): { gateway: boolean; right: boolean; lease: boolean } {
  return { gateway: hall.isThere, right: session.may(view.name), lease: lease.robot === view.name };
}

/** Why a control cannot be used now, in words; empty if it can. */
export function reasons(control: Control, view: View): string {
  return unmet(control, view, hasFor(view))
    .map((reason) => settings.words.unmet(reason))
    .join(" · ");
}

/** What is said if the controller refused it, and not the gateway. `said`: the message of the gateway. */
type Refused = (what: string, said: string) => string;

/** Sends something. `done`: what is said if it worked, in the part of the page where the person acted. */
export async function post<T>(
  robot: string,
  what: string,
  path: string,
  body: object,
  part: Part,
  done: (what: string) => string,
  more: { idempotencyKey?: string; patience?: number; refused?: Refused } = {},
): Promise<Answer<T>> {
  told.say(robot, settings.words.control.sending(what), part);
  const { refused, ...with_ } = more;
  const answer = await call<T>("POST", robotPath(robot, path), { body, csrf: session.csrf, ...with_ });
  const isByController = answer.kind === "refused" && answer.problem.code === "refused";
  if (answer.kind === "ok") told.say(robot, done(what), part);
  else if (isByController && refused !== undefined) {
    told.say(robot, refused(what, answer.problem.message), part, true, answer.problem);
  }
  else told.answer(robot, what, answer, settings.words, part);
  return answer;
}

/** Sends a command with the lease of this page. Returns whether the controller accepted it. */
export async function command(
  robot: string,
  what: string,
  word: string,
  args: readonly string[],
  part: Part,
  more: { run_leftover?: boolean; done?: (what: string) => string; refused?: Refused } = {},
): Promise<boolean> {
  const key = lease.key(robot);
  const { done = settings.words.controls.taken, refused, ...with_ } = more;
  const body = { command: word, arguments: args, ...(key === null ? {} : { lease: key }), ...with_ };
  const answer = await post<CommandDone>(robot, what, "commands", body, part, done, refused === undefined ? {} : { refused });
  return answer.kind === "ok";
}
