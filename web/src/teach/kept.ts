/** What is said of a program that the gateway keeps. */
import type { ProgramVersion } from "../api/types.ts";

/** `no_step`: there is no step in it, as in a program that has only points yet. That is no mistake. */
export type Kept = "ok" | "taught" | "no_step" | "mistakes";

export function keptAs({ ok, kind }: Pick<ProgramVersion, "ok" | "kind">): Kept {
  if (kind === "neither") return "no_step";
  if (!ok) return "mistakes";
  return kind === "taught" ? "taught" : "ok";
}
