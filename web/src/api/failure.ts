/** Why a request was not carried out, or that this is not known. */
import type { Answer } from "./client.ts";
import type { Code } from "./types.ts";

export interface Failure {
  /** The code of the gateway; `no_answer` if none came. */
  code: Code | "no_answer";
  /** What the gateway says, in English. */
  message: string;
}

/** `null` if the request was carried out. */
export function failureOf(answer: Exclude<Answer<unknown>, { kind: "ok" }>): Failure;
export function failureOf(answer: Answer<unknown>): Failure | null;
export function failureOf(answer: Answer<unknown>): Failure | null {
  if (answer.kind === "ok") return null;
  return answer.kind === "unknown" ? { code: "no_answer", message: "" } : answer.problem;
}
