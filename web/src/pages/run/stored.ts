/** Whether a kept program is still the one that was checked. */
import { call } from "../../api/client.ts";
import type { StoredProgram } from "../../api/types.ts";

/** Which version of which kept program, and the SHA-256 of its text: the gateway runs no other text for it. */
export interface Kept {
  name: string;
  version: number;
  sha256: string;
}

/**
 * Reads the program again. `another`: its text or its version is another one now, or it is gone. The number of a
 * version is not enough: a program that was removed and stored anew begins at version 1 again. `signal` gives the question up.
 */
export async function stored({ name, version }: Omit<Kept, "sha256">, text: string, signal: AbortSignal): Promise<"same" | "another" | "no_answer"> {
  const answer = await call<StoredProgram>("GET", `/v1/programs/${encodeURIComponent(name)}`, { signal });
  if (answer.kind === "refused" && answer.status === 404) return "another";
  if (answer.kind !== "ok") return "no_answer";
  return answer.value.version === version && answer.value.program === text ? "same" : "another";
}
