/** The robots that a token or a user is for, and with which role. */
import type { Role } from "../api/types.ts";

/** The role with the fewest rights is first. */
export const ROLES: readonly Role[] = ["viewer", "operator", "engineer", "admin"];
/** Stands for all robots that are not named. */
export const OTHERS = "*";

/** A robot of a grant. */
export interface Granted {
  /** Its name, or `OTHERS`. */
  name: string;
  /** Its own role; `null` if it has that of the grant. */
  role: Role | null;
}

/** `robots`: as the API has them, such as `press-4,saw=viewer`; `null` for all robots, which have no names here. */
export function grantedOf(robots: string | null): Granted[] {
  if (robots === null || robots === "") return [];
  return robots.split(",").map((part) => {
    const [name = "", word] = part.split("=", 2);
    // What is no role gives no right.
    return { name, role: word === undefined ? null : (ROLES.find((role) => role === word) ?? "viewer") };
  });
}

/** The same as the API has it. */
export function textOf(granted: readonly Granted[]): string {
  return granted.map(({ name, role }) => (role === null ? name : `${name}=${role}`)).join(",");
}

/** Whether this role has the rights of the other one. */
export function isAtLeast(role: Role, least: Role): boolean {
  return ROLES.indexOf(role) >= ROLES.indexOf(least);
}

/** The lower one of both. */
function lower(one: Role, other: Role): Role {
  return isAtLeast(one, other) ? other : one;
}

/** The role for this robot, or for all robots alike (`null`); `null` if there is none. */
export function roleFor(role: Role, robots: string | null, robot: string | null): Role | null {
  if (robots === null) return role;
  if (robot === null || robot === "" || robot === OTHERS) return null;
  const granted = grantedOf(robots);
  const found = granted.find(({ name }) => name === robot) ?? granted.find(({ name }) => name === OTHERS);
  return found === undefined ? null : lower(role, found.role ?? role);
}

/** The highest role for one robot at least. */
export function highest(role: Role, robots: string | null): Role {
  const each = grantedOf(robots).map((one) => lower(role, one.role ?? role));
  return ROLES.findLast((one) => each.includes(one)) ?? role;
}
