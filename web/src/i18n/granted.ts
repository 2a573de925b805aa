import type { Role } from "../api/types.ts";
import { OTHERS, grantedOf } from "../state/rights.ts";

/** The robots of a token or a user in words: `own` puts a role behind a name. */
export function granted(
  robots: string | null,
  all: string,
  others: string,
  comma: string,
  own: (role: Role) => string,
): string {
  if (robots === null) return all;
  if (robots === OTHERS) return `${all} (*)`;
  const one = (name: string, role: Role | null): string => (name === OTHERS ? others : name) + (role === null ? "" : own(role));
  return grantedOf(robots).map(({ name, role }) => one(name, role)).join(comma);
}
