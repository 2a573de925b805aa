/**
 * Looks for entries of the audit log, the latest first. The gateway gives pages in the order of the log and knows no
 * filters, so the search reads windows backwards, a few at a time, and says how far it came.
 */
import type { Answer } from "../../api/client.ts";
import type { Audit, AuditEntry } from "../../api/types.ts";

/** How many entries one question asks for, and how many questions one search asks at most. */
export const WINDOW = 500;
export const MAX_WINDOWS = 10;
/** How many entries a page shows. */
export const SHOWN = 50;

export type What = AuditEntry["what"];

/** The kinds of the filter, and what is of each. `refused` is of none: it goes by how something ended. */
export const KINDS = {
  stop: ["stop", "stop_began", "stop_cleared", "owed_stop_forgotten"],
  refused: [],
  command: ["command_intent", "command_outcome", "photo_answer"],
  run: ["run_intent", "run_outcome"],
  lease: ["lease_began", "lease_ended"],
  alarm: ["alarm_acknowledged", "alarm_shelved", "alarm_unshelved"],
  sign_in: ["signed_in", "signed_out", "sign_in_failed"],
  people: ["user_made", "user_changed", "user_removed", "link_made", "token_made", "token_revoked", "camera_granted", "camera_revoked"],
  robot: ["robot_configured", "robot_removed", "identity_changed", "identity_accepted"],
  program: ["program_stored", "program_removed", "point_stored", "point_removed"],
  settings: ["settings_changed", "raw_rules", "raw_ports"],
  gateway: ["gateway_started", "gateway_ended", "restored", "audit_key"],
} as const satisfies Record<string, readonly What[]>;

export type Kind = keyof typeof KINDS;

export interface Filter {
  /** A name; empty is all. */
  robot: string;
  /** A part of the actor, in any case; empty is all. */
  who: string;
  kind: Kind | "";
  /** Instants, the second one not included; `null` is no limit. */
  from: number | null;
  to: number | null;
}

export interface Found {
  /** The latest first. */
  entries: AuditEntry[];
  /** The commands of the entries that were read, by the number of their entry: an outcome names only that. */
  commands: Map<number, string>;
  /** Where older entries begin: those below this number were not looked at; `null` at the begin of the log. */
  next: number | null;
  /** When the oldest entry was made that was looked at; `null` if none was seen. */
  back: string | null;
}

/** Whether what was asked for was refused. */
export function isRefused(entry: AuditEntry): boolean {
  switch (entry.what) {
    case "refused":
    case "sign_in_failed":
      return true;
    case "command_outcome":
      return entry.outcome === "refused";
    case "run_outcome":
      return entry.state === "refused";
    default:
      return false;
  }
}

export function passes(entry: AuditEntry, filter: Filter): boolean {
  if (filter.robot !== "" && entry.robot !== filter.robot) return false;
  if (filter.who !== "" && !entry.actor.toLowerCase().includes(filter.who.toLowerCase())) return false;
  if (filter.kind === "refused" && !isRefused(entry)) return false;
  if (filter.kind !== "" && filter.kind !== "refused") {
    if (!(KINDS[filter.kind] as readonly What[]).includes(entry.what)) return false;
  }
  const at = Date.parse(entry.time);
  return (filter.from === null || at >= filter.from) && (filter.to === null || at < filter.to);
}

type Ask = (after: number, limit: number) => Promise<Answer<Audit>>;

/** Looks at the entries below the number `before`, until a page is full or enough was read. */
export async function search(ask: Ask, before: number, filter: Filter): Promise<Answer<Found>> {
  const found: Found = { entries: [], commands: new Map(), next: before, back: null };
  for (let windows = 0; windows < MAX_WINDOWS && found.next !== null; windows += 1) {
    const end: number = found.next;
    const after = Math.max(0, end - 1 - WINDOW);
    const limit = end - 1 - after;
    if (limit < 1) {
      found.next = null;
      break;
    }
    const answer = await ask(after, limit);
    if (answer.kind !== "ok") return answer;
    const { entries, next_after } = answer.value;
    // Where the begin of the log was removed, the answer has later entries.
    const window = entries.filter(({ number }) => number < end);
    const isBegin = after === 0 || (next_after !== null && next_after > after + limit);
    found.next = isBegin ? null : after + 1;
    found.back = window[0]?.time ?? found.back;
    for (const entry of window) {
      if (entry.what === "command_intent") found.commands.set(entry.number, entry.command);
    }
    for (const entry of window.reverse()) {
      if (!passes(entry, filter)) continue;
      found.entries.push(entry);
      if (found.entries.length === SHOWN) {
        found.next = entry.number > 1 ? entry.number : null;
        found.back = entry.time;
        return { kind: "ok", value: found };
      }
    }
    // A clock that was set back makes single entries look early, hardly a whole window.
    const { from } = filter;
    if (from !== null && window.length > 0 && window.every(({ time }) => Date.parse(time) < from)) found.next = null;
  }
  return { kind: "ok", value: found };
}

/** The number of the first entry that is not before `to`, or a number a little above; `head` is the last one. */
export async function numberAt(ask: Ask, head: number, to: number): Promise<Answer<number>> {
  let [low, high] = [1, head + 1];
  while (high - low > WINDOW) {
    const middle = Math.floor((low + high) / 2);
    const answer = await ask(middle - 1, 1);
    if (answer.kind !== "ok") return answer;
    const [entry] = answer.value.entries;
    // What was removed is older than what is there.
    if (entry === undefined || Date.parse(entry.time) >= to) high = Math.min(middle, high - 1);
    else low = Math.max(entry.number, low + 1);
  }
  return { kind: "ok", value: high };
}
