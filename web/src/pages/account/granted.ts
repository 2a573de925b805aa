import type { Granted } from "../../state/rights.ts";

/** Robots as the API has them. */
export function textOf(granted: readonly Granted[]): string {
  return granted.map(({ name, role }) => (role === null ? name : `${name}=${role}`)).join(",");
}
