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
/** When a stop without a proof is sent again, after it was pressed. */
export const AGAIN: readonly number[] = [700, 2_000];
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
  /** Ends the requests: another stop needs their connections. */
  signal?: AbortSignal;
  /** When it is sent again, in milliseconds. */
  again?: readonly number[];
  /**
   * How many of the browser's six connections it takes at most: if it is sent again, the oldest request is given up. What
   * arrived is carried out all the same, because the gateway does not wait for its caller.
   */
  atATime?: number;
  world?: World;
}

/**
 * Stops a robot. `tell` is called with each state, `sending` first, before this returns. A connection may be dead
 * while new ones work, and a stop may be carried out twice: without a proof it is sent again at the times of `again`,
 * in milliseconds. The first proof counts.
 */
export async function stop(
  robot: string,
  csrf: string | null,
  tell: (state: StopState) => void,
  { isLost = false, signal, world = WORLD, again = AGAIN, atATime = 2 }: Options = {},
): Promise<void> {
  tell({ kind: "sending" });
  const abort = new AbortController();
  const giveUp = (): void => {
    abort.abort();
    if (underWay === 0) end();
  };
  signal?.addEventListener("abort", giveUp);
  const cancels: (() => void)[] = [];
  let [underWay, waiting, isOver] = [0, again.length, false];
  // Whether a request may have arrived whose answer did not come.
  let mayBeSent = false;
  let last: StopState | null = null;
  let finish = (): void => {};
  const finished = new Promise<void>((done) => (finish = done));
  const end = (): void => {
    isOver = true;
    finish();
  };
  const requests: AbortController[] = [];
  const cancelSoon = world.after(SOON, () => tell({ kind: "not_confirmed", why: "no_answer" }));
  cancels.push(cancelSoon, world.after(PATIENCE, giveUp));
  const attempt = async (): Promise<void> => {
    const own = new AbortController();
    const ending = AbortSignal.any([abort.signal, own.signal]);
    underWay += 1;
    if (requests.push(own) > atATime) requests.shift()?.abort();
    const state = await once(robot, csrf, { isLost, ending, isGivenUp: () => signal?.aborted === true, world });
    underWay -= 1;
    if (requests.includes(own)) requests.splice(requests.indexOf(own), 1);
    if (isOver) return;
    mayBeSent ||= state.kind === "not_confirmed";
    const isRefused = state.kind === "not_sent" && state.why !== "no_gateway" && !mayBeSent && underWay === 0;
    const isEnd = state.kind === "stopped" || isRefused;
    // Of a stop that is on its way too, nothing is known yet.
    if (isEnd || underWay === 0) {
      cancelSoon();
      const known: StopState = state.kind === "not_sent" && mayBeSent ? { kind: "not_confirmed", why: state.why } : state;
      if (JSON.stringify(known) !== JSON.stringify(last)) tell(known);
      last = known;
    }
    if (isEnd || abort.signal.aborted || (underWay === 0 && waiting === 0)) end();
  };
  for (const ms of again) {
    cancels.push(
      world.after(ms, () => {
        waiting -= 1;
        if (!isOver && !abort.signal.aborted) void attempt();
      }),
    );
  }
  void attempt();
  await finished;
  for (const cancel of cancels) cancel();
  abort.abort();
  signal?.removeEventListener("abort", giveUp);
}

interface Once {
  isLost: boolean;
  /** Ends the request. */
  ending: AbortSignal;
  /** Whether another stop needs its connection. */
  isGivenUp(): boolean;
  world: World;
}

/** Sends it once: what became of that. */
async function once(robot: string, csrf: string | null, { isLost, ending, isGivenUp, world }: Once): Promise<StopState> {
  const begun = world.now();
  const path = `/v1/robots/${encodeURIComponent(robot)}/stop`;
  const send = async (proof: string | null): Promise<[Response, unknown]> => {
    const response = await world.fetch(path, {
      method: "POST",
      headers: proof === null ? {} : { "X-CSRF-Token": proof },
      signal: ending,
      cache: "no-store",
      keepalive: true,
      priority: "high",
    });
    return [response, await response.json().catch(() => null)];
  };
  try {
    let [response, body] = await send(csrf);
    if (response.status === 403 && codeOf(body) === "bad_csrf") {
      // Another tab has begun another session. A stop that was refused for that never left the gateway.
      const proof = await proofNow(world, ending);
      if (proof !== null && proof !== csrf) [response, body] = await send(proof);
    }
    if (response.ok && isStopped(body)) return { kind: "stopped", at: seenAt(response, body, world), took: body.took_ms };
    return { kind: NOT_SENT.has(response.status) ? "not_sent" : "not_confirmed", why: codeOf(body) };
  } catch {
    const isAtOnce = world.now() - begun < AT_ONCE;
    if (isGivenUp()) return { kind: "not_confirmed", why: "given_up" };
    if (ending.aborted) return { kind: "not_confirmed", why: "no_answer" };
    return { kind: isLost && isAtOnce ? "not_sent" : "not_confirmed", why: "no_gateway" };
  }
}

/** When it was seen that the arm stands, on the gateway's clock: the answer may be late. */
function seenAt(response: Response, body: { seen_at?: unknown }, world: World): Date {
  for (const told of [body.seen_at, response.headers.get("Date")]) {
    const at = typeof told === "string" ? new Date(told) : null;
    if (at !== null && !Number.isNaN(at.getTime())) return at;
  }
  return world.hallTime();
}

/** The proof of the session that is open now; `null` if there is no session. */
async function proofNow(world: World, signal: AbortSignal): Promise<string | null> {
  const response = await world.fetch("/v1/session", { signal, cache: "no-store", priority: "high" });
  const body: unknown = await response.json().catch(() => null);
  if (!response.ok || typeof body !== "object" || body === null || !("csrf" in body)) return null;
  return typeof body.csrf === "string" ? body.csrf : null;
}

function isStopped(body: unknown): body is { confirmed: true; took_ms: number; seen_at?: unknown } {
  return typeof body === "object" && body !== null && "confirmed" in body && body.confirmed === true;
}

function codeOf(body: unknown): string {
  if (typeof body === "object" && body !== null && "code" in body) return String(body.code);
  return "unknown";
}
