/** What the person at this browser may do. The gateway checks it again. */
import type { Role } from "../api/types.ts";
import { session } from "./session.svelte.ts";

const ORDER: readonly Role[] = ["viewer", "operator", "engineer", "admin"];

/** Whether the session has at least this role for a robot. */
export function mayAs(role: Role, robot: string): boolean {
  const { session: of } = session;
  if (of === null || (of.robot !== null && of.robot !== robot)) return false;
  return ORDER.indexOf(of.role) >= ORDER.indexOf(role);
}
