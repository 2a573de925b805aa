import { expect, test } from "vitest";
import { type Access, type Trial, isFreeToTake, trialOf } from "./trial.ts";

const ROWS: [what: string, of: Parameters<typeof trialOf>[0], ran: string[], is: Trial][] = [
  ["an arm whose twin has not run it", { virtual: false, twin: "t", twin_of: null }, [], { hasTwin: true, needsNoTrial: false, tried: false }],
  ["an arm whose twin ran it", { virtual: false, twin: "t", twin_of: null }, ["t"], { hasTwin: true, needsNoTrial: false, tried: true }],
  ["an arm when another twin ran it", { virtual: false, twin: "t", twin_of: null }, ["u"], { hasTwin: true, needsNoTrial: false, tried: false }],
  ["an arm without a twin", { virtual: false, twin: null, twin_of: null }, ["t"], { hasTwin: false, needsNoTrial: false, tried: false }],
  ["a robot of unknown kind without a twin", { virtual: null, twin: null, twin_of: null }, ["t"], { hasTwin: false, needsNoTrial: false, tried: false }],
  ["a virtual robot whose twin has not run it", { virtual: true, twin: "t", twin_of: null }, [], { hasTwin: true, needsNoTrial: false, tried: false }],
  ["a virtual robot without a twin", { virtual: true, twin: null, twin_of: null }, [], { hasTwin: true, needsNoTrial: true, tried: true }],
  ["the twin", { virtual: true, twin: null, twin_of: "arm" }, [], { hasTwin: true, needsNoTrial: true, tried: true }],
  ["a twin whose link was just lost", { virtual: null, twin: null, twin_of: "arm" }, [], { hasTwin: true, needsNoTrial: true, tried: true }],
];

test("a text runs on its twin first, wherever there is one, and on no arm without one", () => {
  for (const [what, of, ran, is] of ROWS) expect(trialOf(of, (twin) => ran.includes(twin)), what).toEqual(is);
});

test("control is taken only where nobody has it, this page may have it, and the gateway is heard", () => {
  const free: Access = { gateway: true, right: true, lease: false, isHeld: false };
  expect(isFreeToTake(free)).toBe(true);
  for (const part of [{ gateway: false }, { right: false }, { lease: true }, { isHeld: true }]) {
    expect(isFreeToTake({ ...free, ...part }), JSON.stringify(part)).toBe(false);
  }
});
