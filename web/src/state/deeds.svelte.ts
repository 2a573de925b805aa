/**
 * What was done to each robot lately: the gateway keeps its last 1000 events, which are read once, and what
 * happens from then on is added. Only the page of a robot follows it.
 */
import type { GatewayEvent } from "../api/types.ts";
import { type Deeds, NO_DEEDS, afterEvent, eventsOf } from "../robots/deeds.ts";
import { stops } from "../stop/stops.ts";
import { hall } from "./hall.svelte.ts";

/**
 * The kept events come at once: after this time without more, in milliseconds, all are there. At most so
 * long.
 */
const QUIET = 500;
const LONGEST = 5_000;
/** How long a question that had no answer waits to be asked again. */
const AGAIN = 3_000;
/** As many events as the gateway keeps. */
const KEPT = 1_000;

class DeedsState {
  #robots = $state.raw(new Map<string, Deeds>());
  /** Whether the kept events were read: before that, what was done earlier is not known. */
  isRead = $state(false);
  /** The kept events of all robots and those since, the earliest first. */
  events = $state.raw<readonly GatewayEvent[]>([]);
  #last = 0;

  of(robot: string): Deeds {
    return this.#robots.get(robot) ?? NO_DEEDS;
  }

  /** Reads what the gateway kept, and follows. Returns what ends it. */
  follow(): () => void {
    const over = new AbortController();
    this.isRead = false;
    // Numbers of events begin anew with each start of the gateway.
    this.#last = 0;
    const live: GatewayEvent[] = [];
    const unread = hall.onEvent((event) => {
      live.push(event);
      if (live.length > KEPT) live.shift();
      this.#take([event]);
    });
    void this.#read(over.signal, live);
    return () => {
      over.abort();
      unread();
    };
  }

  /** Reads what the gateway kept, until that works. `live`: what happened since. */
  async #read(signal: AbortSignal, live: readonly GatewayEvent[]): Promise<void> {
    let events = await past(signal);
    while (events === null && !signal.aborted) {
      await new Promise((next) => setTimeout(next, AGAIN));
      if (!signal.aborted) events = await past(signal);
    }
    if (events === null || signal.aborted) return;
    this.#robots = new Map();
    this.events = [];
    this.#last = 0;
    this.#take([...events, ...live]);
    this.isRead = true;
  }

  /** Each event counts once. Their numbers grow. */
  #take(events: GatewayEvent[]): void {
    const robots = new Map(this.#robots);
    const fresh: GatewayEvent[] = [];
    for (const event of events) {
      if (event.id <= this.#last) continue;
      this.#last = event.id;
      fresh.push(event);
      robots.set(event.robot, afterEvent(robots.get(event.robot) ?? NO_DEEDS, event));
    }
    this.#robots = robots;
    if (fresh.length > 0) this.events = [...this.events, ...fresh].slice(-KEPT);
  }
}

/**
 * The events that the gateway keeps; `null` if they cannot be read. It gives its connection up for a stop.
 */
async function past(signal: AbortSignal): Promise<GatewayEvent[] | null> {
  if (stops.isBusy) return null;
  const over = new AbortController();
  const end = (): void => over.abort();
  const unread = stops.onChange(() => {
    if (stops.isBusy) end();
  });
  signal.addEventListener("abort", end);
  let text = "";
  let timer = setTimeout(end, LONGEST);
  const longest = setTimeout(end, LONGEST);
  let isThere = false;
  try {
    const headers = { "Last-Event-ID": "0", Accept: "text/event-stream" };
    const response = await fetch("/v1/events", { headers, cache: "no-store", signal: over.signal });
    isThere = response.ok;
    const reader = response.body?.pipeThrough(new TextDecoderStream()).getReader();
    while (isThere && reader !== undefined) {
      const { done, value } = await reader.read();
      if (done) break;
      text += value;
      clearTimeout(timer);
      timer = setTimeout(end, QUIET);
    }
  } catch {
    // It was ended: by the time, by a stop, or by the network.
  } finally {
    clearTimeout(timer);
    clearTimeout(longest);
    unread();
    signal.removeEventListener("abort", end);
  }
  return isThere ? eventsOf(text) : null;
}

export const deeds = new DeedsState();
