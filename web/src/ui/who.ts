/** Who a session is of, and what it may do. */
import type { Session } from "../api/types.ts";
import { plain } from "../i18n/plain.ts";
import type { en } from "../i18n/en.ts";

export function whoOf({ user, token, token_name: name, role }: Session, words: typeof en): string {
  const named = name ? ` (${plain(name)})` : "";
  return `${user !== null ? plain(user) : words.token(token ?? 0) + named} · ${words.role(role)}`;
}
