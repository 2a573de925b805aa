/** Who a session is of, and what it may do. */
import type { Session } from "../api/types.ts";
import { plain } from "../i18n/plain.ts";
import type { en } from "../i18n/en.ts";
import { highest } from "../state/rights.ts";

export function whoOf({ user, token, token_name: name, role, robot }: Session, words: typeof en): string {
  const named = name ? ` (${plain(name)})` : "";
  return `${user !== null ? plain(user) : words.token(token ?? 0) + named} · ${words.role(highest(role, robot))}`;
}
