import { expect, test } from "vitest";
import type { Run } from "../api/types.ts";
import { isOpen, isUnsent, mayRun, runOf, sentBy } from "./sent.ts";

const NO = { code: "not_ready" as const, message: "" };

test("without a clear answer the outcome is unknown", () => {
  const run = { state: "running" } as Run;
  const refused = (status: number, code: string) =>
    sentBy({ kind: "refused", status, problem: { code: code as "refused", message: "no" } }).kind;
  expect(sentBy({ kind: "ok", value: run })).toEqual({ kind: "accepted", run });
  expect(sentBy({ kind: "ok", value: { ...run, state: "done" } }).kind).toBe("ended");
  expect(sentBy({ kind: "unknown" }).kind).toBe("unknown");
  expect([refused(504, "outcome_unknown"), refused(502, "unknown"), refused(500, "unknown")]).toEqual([
    "unknown",
    "unknown",
    "unknown",
  ]);
  expect(refused(409, "refused"), "the list was sent").toBe("list_refused");
  expect([refused(409, "stopped"), refused(422, "bad_program"), refused(503, "overloaded")]).toEqual([
    "refused",
    "refused",
    "refused",
  ]);
  expect([mayRun(null), mayRun({ kind: "sent" }), mayRun({ kind: "ended", run }), mayRun({ kind: "unknown" })]).toEqual([
    false,
    true,
    false,
    false,
  ]);
});

test("a plan is not used up only if it is certain that nothing was carried out", () => {
  const ended = (state: Run["state"]) => ({ kind: "ended", run: { state } as Run }) as const;
  const all = [
    null,
    { kind: "sent" },
    { kind: "refused", failure: NO },
    { kind: "unknown" },
    { kind: "list_refused", failure: NO },
    ended("refused"),
    ended("failed"),
    ended("unknown"),
  ] as const;
  expect(all.map(isUnsent)).toEqual([false, false, true, false, false, true, false, false]);
  expect(all.map(isOpen)).toEqual([false, false, false, true, false, false, false, true]);
  expect(all.map((one) => runOf(one) !== null)).toEqual([false, false, false, false, false, true, true, true]);
});
