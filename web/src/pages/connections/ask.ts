/** Questions of the page of connections. */
import { type Answer, call } from "../../api/client.ts";
import { robotPath } from "../../api/paths.ts";
import { type Sample, samplesIn } from "./metrics.ts";
import type { HistoryEvent, HistoryEvents } from "./types.ts";

/** The numbers of the gateway. They come as text. */
export async function metrics(): Promise<Answer<Sample[]>> {
  const answer = await call<string>("GET", "/metrics", { isText: true });
  return answer.kind === "ok" ? { kind: "ok", value: samplesIn(answer.value) } : answer;
}

const DAY = 24 * 60 * 60_000;

/** When the link of a robot was lost and found, and not seen, in the 24 h before `to`; of more than 5000, the first. */
export async function linkEvents(robot: string, to: number): Promise<Answer<HistoryEvent[]>> {
  const from = to - DAY;
  const events: HistoryEvent[] = [];
  let cursor: string | null = null;
  for (let pages = 0; pages < 5; pages += 1) {
    const query = new URLSearchParams({ kind: "link_lost,link_back,unseen", from: new Date(from).toISOString() });
    if (cursor !== null) query.set("cursor", cursor);
    const path = robotPath(robot, `history/events?${query}`);
    const answer: Answer<HistoryEvents> = await call("GET", path);
    if (answer.kind !== "ok") return answer;
    events.push(...answer.value.events);
    cursor = answer.value.next_cursor;
    if (cursor === null) break;
  }
  return { kind: "ok", value: events };
}
