/** Questions about the history, which take a while and of which the gateway answers few at a time. */
import { type Answer, call } from "./client.ts";

/** The gateway is busy with other queries: how long to wait, in milliseconds, and how often to ask. */
const BUSY = 500;
const TRIES = 20;
/** A query of a million samples takes a while on a slow machine, in milliseconds. */
export const PATIENCE = 30_000;

/** Asks; again while the gateway is busy with the queries of others. A question changes nothing. */
export async function patiently<T>(path: string, signal: AbortSignal): Promise<Answer<T>> {
  for (let tries = 1; ; tries += 1) {
    const answer = await call<T>("GET", path, { signal, patience: PATIENCE });
    const isBusy = answer.kind === "refused" && answer.problem.code === "overloaded";
    if (!isBusy || tries >= TRIES || signal.aborted) return answer;
    await new Promise((next) => setTimeout(next, BUSY));
  }
}
