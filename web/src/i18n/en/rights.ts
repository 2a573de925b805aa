/** Roles, and the robots that they are for. */
import type { Role } from "../../api/types.ts";
import { OTHERS } from "../../state/rights.ts";
import { granted } from "../granted.ts";

export const ROLES: Record<Role, string> = { viewer: "viewer", operator: "operator", engineer: "engineer", admin: "admin" };

/** The robots of a token or a user. */
export const robotsOf = (robots: string | null): string =>
  granted(robots, "all robots", "all others", ", ", (role) => ` (${ROLES[role]})`);

/** What a token or a user may do, and with which robots. */
export function rights(role: Role, robots: string | null): string {
  return `${ROLES[role]}, ${robotsOf(robots)}${robots === null || robots.includes(OTHERS) ? "" : " only"}`;
}
