/** Who a session is of, and what it may do. */
import type { Session } from "../api/types.ts";
import type { en } from "../i18n/en.ts";

export function whoOf({ user, token, role }: Session, words: typeof en): string {
  return `${user ?? words.token(token ?? 0)} · ${words.role(role)}`;
}
