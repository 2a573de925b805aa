/** What is known of a program that was sent. */
import type { Answer } from "../api/client.ts";
import type { Failure } from "../api/failure.ts";
import type { Run } from "../api/types.ts";

/** `sent`: no answer yet. `unknown`: whether it was carried out is not known. */
export type Sent =
  | { kind: "sent" }
  | { kind: "accepted"; run: Run }
  /** The gateway is not heard, or its answer of the run is old. */
  | { kind: "unheard"; run: Run }
  | { kind: "ended"; run: Run }
  /** The gateway sent nothing. */
  | { kind: "refused"; failure: Failure }
  /** The controller refused the list. Its program may have been stopped by that. */
  | { kind: "list_refused"; failure: Failure }
  | { kind: "unknown" };

/** What an answer to the request tells. */
export function sentBy(answer: Answer<Run>): Sent {
  if (answer.kind === "ok") return ofRun(answer.value);
  if (answer.kind === "unknown" || answer.status >= 500) {
    // A gateway that is busy, or whose disk fails, sent nothing: its code says so.
    const isCertain = answer.kind === "refused" && (answer.problem.code === "overloaded" || answer.problem.code === "store_unavailable");
    if (!isCertain) return { kind: "unknown" };
  }
  // With this code the list was sent.
  const kind = answer.problem.code === "refused" ? "list_refused" : "refused";
  return { kind, failure: answer.problem };
}

export function ofRun(run: Run): Sent {
  return run.state === "running" ? { kind: "accepted", run } : { kind: "ended", run };
}

/** The run, if it has a number. */
export function runOf(sent: Sent | null): Run | null {
  return sent !== null && "run" in sent ? sent.run : null;
}

/** Whether it is not known what became of it. */
export function isOpen(sent: Sent | null): boolean {
  return sent?.kind === "unknown" || (sent?.kind === "ended" && sent.run.state === "unknown");
}

/** Whether the run may still be under way. */
export function mayRun(sent: Sent | null): boolean {
  return sent !== null && (sent.kind === "sent" || sent.kind === "accepted" || sent.kind === "unheard");
}

/** Whether it is certain that no step of it was carried out. */
export function isUnsent(sent: Sent | null): boolean {
  return sent?.kind === "refused" || (sent?.kind === "ended" && sent.run.state === "refused");
}
