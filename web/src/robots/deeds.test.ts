import { expect, test } from "vitest";
import type { GatewayEvent } from "../api/types.ts";
import { type Deeds, NO_DEEDS, afterEvent, eventsOf } from "./deeds.ts";

let id = 0;

function event(what: object, second = 0): GatewayEvent {
  id += 1;
  const time = new Date(Date.UTC(2026, 10, 26, 10, 42, second)).toISOString();
  return { id, time, robot: "saw", ...what } as unknown as GatewayEvent;
}

const after = (events: object[], before: Deeds = NO_DEEDS): Deeds =>
  events.reduce<Deeds>((deeds, what, at) => afterEvent(deeds, event(what, at)), before);

test("a stop is proved once one of those that hold together proved it", () => {
  const doubtful = after([{ event: "stop_began", by: "op-2" }, { event: "stop_ended", confirmed: false }]);
  expect(doubtful.proved).toBe(false);
  const seen = after([{ event: "stop_ended", confirmed: true }, { event: "stop_ended", confirmed: false }], doubtful);
  expect(seen.proved).toBe(true);
  // It holds for the name, also if another machine answers.
  expect(after([{ event: "identity_changed", expected: {}, found: {} }], seen).proved).toBe(true);
  expect(after([{ event: "stop_cleared" }], seen).proved).toBeNull();
});

test("a run is followed to its end, and an older one does not change it", () => {
  const deeds = after([
    { event: "run_began", run_id: 4, program: "pick", steps: 9 },
    { event: "run_progress", run_id: 3, accepted: 1, done: 1 },
    { event: "run_progress", run_id: 4, accepted: 7, done: 2 },
  ]);
  expect(deeds.run).toMatchObject({ id: 4, program: "pick", steps: 9, accepted: 7, done: 2, ended: null });
  const over = after([{ event: "run_ended", run_id: 4, state: "stopped", because: "stop", done: 3 }], deeds);
  expect(over.run).toMatchObject({ done: 3, ended: { state: "stopped", because: "stop" } });
  expect(after([{ event: "identity_changed", expected: {}, found: {} }], over).run, "another machine").toBeNull();
});

test("a stream is read as far as it came", () => {
  const one = 'event: event\ndata: {"id":2,"robot":"saw","event":"stop_cleared"}\nid: 17-2\n\n';
  expect(eventsOf(`event: reset\ndata: {}\n\n: ping\n\n${one}event: event\ndata: {"id":3`)).toEqual([
    { id: 2, robot: "saw", event: "stop_cleared" },
  ]);
});
