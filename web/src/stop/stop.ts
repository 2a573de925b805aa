/**
 * The stop. It has its own request and imports nothing of the page's state, so that no fault of the page
 * keeps it from being sent. It is an ordinary command on a network, not an emergency stop.
 */

/** What is known of a stop. */
export type StopState =
  /** It waits for stops of other robots, and was not sent yet. */
  | { kind: "waiting" }
  | { kind: "sending" }
  | { kind: "stopped"; at: Date; took: number }
  /** It may have been carried out: nothing proves it. */
  | { kind: "not_confirmed"; why: string }
  /** It did not leave the page, or the gateway refused it. */
  | { kind: "not_sent"; why: string };

/** After so long without an answer the page says so, in milliseconds. The answer may still come. */
export const SOON = 3_000;
/**
 * Where the page knows already that the gateway is lost, a request that fails within this time did not reach
 * it. Otherwise it may have: a browser does not say whether a connection was refused or broke.
 */
const AT_ONCE = 1_000;
/** The gateway answers a stop within 20 s. */
const PATIENCE = 25_000;

/** Codes with which the gateway says that it sent nothing. */
const NOT_SENT = new Set([401, 403, 404, 413, 422, 429]);

/** What a stop needs of the outside: for tests. */
export interface World {
  fetch: typeof fetch;
  after(ms: number, act: () => void): () => void;
  /** A clock that only grows, in milliseconds. */
  now(): number;
  /** The time of the hall. */
  hallTime(): Date;
}

let timeOfHall = (): Date => new Date();

/** Says what time it is in the hall from now on. Until then the clock of the browser has to do. */
export function goBy(time: () => Date): void {
  timeOfHall = time;
}

const WORLD: World = {
  fetch: (input, init) => fetch(input, init),
  after(ms, act) {
    const timer = setTimeout(act, ms);
    return () => clearTimeout(timer);
  },
  now: () => performance.now(),
  hallTime: () => timeOfHall(),
};

export interface Options {
  /** Whether the page knows already that the gateway is lost. */
  isLost?: boolean;
  /** Ends the request: another stop needs its connection. */
  signal?: AbortSignal;
  world?: World;
}

/** Stops a robot. `tell` is called with each state, `sending` first, before this returns. */
export async function stop(
  robot: string,
  csrf: string | null,
  tell: (state: StopState) => void,
  { isLost = false, signal, world = WORLD }: Options = {},
): Promise<void> {
  tell({ kind: "sending" });
  const cancel = world.after(SOON, () => tell({ kind: "not_confirmed", why: "no_answer" }));
  const abort = new AbortController();
  const giveUp = (): void => abort.abort();
  signal?.addEventListener("abort", giveUp);
  const begun = world.now();
  const cancelAll = world.after(PATIENCE, giveUp);
  try {
    const path = `/v1/robots/${encodeURIComponent(robot)}/stop`;
    const send = async (proof: string | null): Promise<[Response, unknown]> => {
      const response = await world.fetch(path, {
        method: "POST",
        headers: proof === null ? {} : { "X-CSRF-Token": proof },
        signal: abort.signal,
        cache: "no-store",
        keepalive: true,
        priority: "high",
      });
      return [response, await response.json().catch(() => null)];
    };
    let [response, body] = await send(csrf);
    if (response.status === 403 && codeOf(body) === "bad_csrf") {
      // Another tab has begun another session. A stop that was refused for that never left the gateway.
      const proof = await proofNow(world, abort.signal);
      if (proof !== null && proof !== csrf) [response, body] = await send(proof);
    }
    cancel();
    if (response.ok && isStopped(body)) tell({ kind: "stopped", at: world.hallTime(), took: body.took_ms });
    else if (NOT_SENT.has(response.status)) tell({ kind: "not_sent", why: codeOf(body) });
    else tell({ kind: "not_confirmed", why: codeOf(body) });
  } catch {
    cancel();
    const isAtOnce = world.now() - begun < AT_ONCE;
    if (signal?.aborted) tell({ kind: "not_confirmed", why: "given_up" });
    else if (abort.signal.aborted) tell({ kind: "not_confirmed", why: "no_answer" });
    else tell({ kind: isLost && isAtOnce ? "not_sent" : "not_confirmed", why: "no_gateway" });
  } finally {
    cancelAll();
    signal?.removeEventListener("abort", giveUp);
  }
}

/** The proof of the session that is open now; `null` if there is no session. */
async function proofNow(world: World, signal: AbortSignal): Promise<string | null> {
  const response = await world.fetch("/v1/session", { signal, cache: "no-store", priority: "high" });
  const body: unknown = await response.json().catch(() => null);
  if (!response.ok || typeof body !== "object" || body === null || !("csrf" in body)) return null;
  return typeof body.csrf === "string" ? body.csrf : null;
}

function isStopped(body: unknown): body is { confirmed: true; took_ms: number } {
  return typeof body === "object" && body !== null && "confirmed" in body && body.confirmed === true;
}

function codeOf(body: unknown): string {
  if (typeof body === "object" && body !== null && "code" in body) return String(body.code);
  return "unknown";
}
