import { expect, test } from "vitest";
import type { GatewayEvent } from "../api/types.ts";
import { type Deeds, NO_DEEDS, afterEvent, eventsOf, speedOf } from "./deeds.ts";

let id = 0;

function event(what: object, second = 0): GatewayEvent {
  id += 1;
  const time = new Date(Date.UTC(2026, 10, 26, 10, 42, second)).toISOString();
  return { id, time, robot: "saw", ...what } as unknown as GatewayEvent;
}

const after = (events: object[], before: Deeds = NO_DEEDS): Deeds =>
  events.reduce<Deeds>((deeds, what, at) => afterEvent(deeds, event(what, at)), before);

const began = { event: "lease_began", lease: 3, holder: "op-2" };
const speed = (command_id: number, command: string): object => ({ event: "command_began", command_id, command });
const ended = (command_id: number, outcome: string): object => ({ event: "command_ended", command_id, outcome });

test("who set the global speed, and when, is known once the controller accepted it", () => {
  const deeds = after([began, speed(6, 'modifyGSPD "300"')]);
  expect(deeds.speed).toBeNull();
  const accepted = after([ended(6, "accepted")], deeds);
  expect(accepted.speed).toMatchObject({ percent: 30, by: "op-2", outcome: "accepted" });
  // A refused one changes nothing, an unknown one may have.
  expect(after([speed(7, 'modifyGSPD "600"'), ended(7, "refused")], accepted).speed?.percent).toBe(30);
  expect(after([speed(8, 'modifyGSPD "605"'), ended(8, "unknown")], accepted).speed).toMatchObject({
    percent: 60.5,
    outcome: "unknown",
  });
  expect(after([speed(9, 'modifyOutput "0","2","1"'), ended(9, "accepted")], accepted).speed?.percent).toBe(30);
  expect(after([{ event: "identity_changed", expected: {}, found: {} }], accepted).speed).toBeNull();
});

test("the first stop since a stop was cleared is the one that holds", () => {
  const stopped = after([
    { event: "stop_began", by: "op-2" },
    { event: "stop_began", by: "anna" },
    { event: "stop_ended", confirmed: false },
  ]);
  expect(stopped.stop).toEqual({ by: "op-2", at: Date.UTC(2026, 10, 26, 10, 42, 0), confirmed: false });
  const seen = after([{ event: "stop_ended", confirmed: true }, { event: "stop_ended", confirmed: false }], stopped);
  expect(seen.stop?.confirmed).toBe(true);
  expect(after([{ event: "stop_cleared" }], seen).stop).toBeNull();
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
});

test("a stream is read as far as it came", () => {
  const one = 'event: event\ndata: {"id":2,"robot":"saw","event":"stop_cleared"}\nid: 17-2\n\n';
  expect(eventsOf(`event: reset\ndata: {}\n\n: ping\n\n${one}event: event\ndata: {"id":3`)).toEqual([
    { id: 2, robot: "saw", event: "stop_cleared" },
  ]);
  expect(speedOf('modifyGSPD "5"')).toBe(0.5);
});
