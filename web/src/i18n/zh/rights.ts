/** Roles, and the robots that they are for. */
import type { Role } from "../../api/types.ts";
import { OTHERS } from "../../state/rights.ts";
import { granted } from "../granted.ts";

export const ROLES: Record<Role, string> = { viewer: "观察员", operator: "操作员", engineer: "工程师", admin: "管理员" };

/** The robots of a token or a user. */
export const robotsOf = (robots: string | null): string =>
  granted(robots, "所有机器人", "其他所有机器人", "、", (role) => `（${ROLES[role]}）`);

/** What a token or a user may do, and with which robots. */
export function rights(role: Role, robots: string | null): string {
  return `${ROLES[role]}，${robots === null || robots.includes(OTHERS) ? "" : "仅限 "}${robotsOf(robots)}`;
}
