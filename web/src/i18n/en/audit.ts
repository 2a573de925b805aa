/** Words of the audit log. */
import type { AuditEntry } from "../../api/types.ts";
import type { Kind } from "../../pages/audit/search.ts";
import { rights } from "./rights.ts";
import { count } from "./say.ts";

/** Which gateway, if several share a database. */
const at = ({ url }: { url: string | null }): string => (url === null ? "" : ` ${url}`);

const CAUSES: Record<string, string> = {
  released: "given back",
  expired: "not renewed",
  taken: "taken by an admin",
  identity_changed: "another robot answers",
  reconfigured: "the robot was changed",
  removed: "the robot was removed",
  gateway_ended: "the gateway ended",
};

export const audit = {
  filters: "Filters",
  robot: "Robot",
  who: "Person or token",
  whoHint: "A part of the name is enough.",
  kind: "Kind",
  from: "From",
  to: "To",
  hallTime: "Time of the hall",
  badTime: "This is no time.",
  all: "all",
  clear: "Clear the filters",
  kinds: {
    stop: "Stops",
    refused: "Refused",
    command: "Commands",
    run: "Runs of programs",
    lease: "Control of robots",
    alarm: "Alarms seen or shelved",
    sign_in: "Signing in and out",
    people: "Users and tokens",
    robot: "Robots",
    program: "Stored programs",
    settings: "Settings and rules",
    gateway: "The gateway itself",
  } satisfies Record<Kind, string>,
  entries: "Entries, the latest first",
  time: "Time",
  actor: "Who",
  source: "Address",
  what: "What",
  number: "Entry",
  none: "No entry matches.",
  noneNext: "Clear a filter, or choose a longer span. Reads and renewals of control are not in the log.",
  empty: "The log has no entry that you may see.",
  until: (number: number, at: string) => `Looked back to entry ${number}, ${at}.`,
  older: "Older entries",
  searchOn: "Search on",
  newest: "The latest entries",
  fields: "All fields",
  refused: "refused",
  unseen: "not confirmed",
  gateway: "the gateway itself",
  shell: "the command line at the gateway",
  link: "a one-time link",
  deed: (entry: AuditEntry, command: string | undefined): string => {
    switch (entry.what) {
      case "gateway_started":
        return `The gateway${at(entry)} started.`;
      case "gateway_ended":
        return `The gateway${at(entry)} ended in order.`;
      case "restored":
        return "The folder was restored from a backup. A stop holds for each robot.";
      case "audit_key":
        return "The heads of the log are signed with the present key of this gateway from now on.";
      case "token_made":
        return `Made token ${entry.token}${entry.name === "" ? "" : ` “${entry.name}”`}: ${rights(entry.role, entry.only)}.`;
      case "token_revoked":
        return `Revoked token ${entry.token}.`;
      case "camera_granted":
        return `Let token ${entry.token} feed camera ${entry.camera} without control.`;
      case "camera_revoked":
        return `Token ${entry.token} may not feed camera ${entry.camera} any more.`;
      case "photo_answer":
        return `Answers the photo of camera ${entry.camera}: ${entry.taken ? "taken" : "failed"}.`;
      case "user_made":
        return `Made user ${entry.user}: ${rights(entry.role, entry.only)}${entry.disabled ? ", disabled" : ""}.`;
      case "user_changed":
        return `Changed user ${entry.user}: ${rights(entry.role, entry.only)}${entry.disabled ? ", disabled" : ""}${entry.new_password ? ", another password" : ""}.`;
      case "user_removed":
        return `Removed user ${entry.user}.`;
      case "link_made":
        return entry.user === null ? "Made a one-time link for the first admin." : `Made a one-time link for ${entry.user}.`;
      case "signed_in":
        return "Signed in.";
      case "signed_out":
        return "Signed out.";
      case "sign_in_failed":
        return `${count(entry.times, "try", "tries")} to sign in as ${entry.user} failed.`;
      case "lease_began":
        return entry.taken_because === null
          ? "Took control."
          : `Took control from somebody else, because: “${entry.taken_because}”.`;
      case "lease_ended":
        return `Control${entry.holder ? ` of ${entry.holder}` : ""} ended: ${CAUSES[entry.cause] ?? entry.cause}.`;
      case "command_intent":
        return `Sends the command ${entry.command}.`;
      case "command_outcome":
        return `The command ${command ?? `of entry ${entry.intent}`} ${
          {
            accepted: "was accepted by the controller.",
            refused: "was refused.",
            not_sent: "was not sent.",
            unknown: "left, and its outcome is not known.",
          }[entry.outcome]
        }`;
      case "run_intent":
        return `Runs ${entry.program === null ? "a program" : `${entry.program}${entry.version === null ? "" : ` version ${entry.version}`}`}: ${count(entry.steps, "step", "steps")}, ${count(entry.repeat, "time", "times")}.`;
      case "run_outcome":
        return `Run ${entry.run} ${
          {
            running: "runs",
            done: "is done",
            stopped: "was stopped",
            refused: "was refused",
            failed: "failed",
            unknown: "ended, and what was carried out is not known",
          }[entry.state]
        }; ${count(entry.done, "step", "steps")} seen to be done (${entry.because}).`;
      case "refused":
        return `${entry.request}: refused (${entry.code}).`;
      case "stop_began":
        return entry.request === "stop" ? "Asked for a stop." : `Asked for a stop with ${entry.request}.`;
      case "stop":
        if (!entry.confirmed) return entry.request === "stop" ? "Stop: NOT CONFIRMED." : `Stop with ${entry.request}: NOT CONFIRMED.`;
        return entry.request === "stop"
          ? "Stopped. It was seen that the arm stands."
          : `Stop with ${entry.request}: accepted. Whether the arm stood was not looked at.`;
      case "stop_cleared":
        return "Cleared the stop.";
      case "owed_stop_forgotten":
        return `Said that the arm is gone, so that a list of a run at it is not stopped any more, because: “${entry.because}”.`;
      case "identity_changed":
        return `Another robot answers: ${entry.found.machine_name ?? "?"}, not ${entry.expected.machine_name ?? "?"}.`;
      case "identity_accepted":
        return `Accepted the robot that answers: ${entry.identity.machine_name ?? "?"}.`;
      case "robot_configured":
        return `Added or changed the robot: ${entry.address}, read every ${entry.period_ms} ms.`;
      case "robot_removed":
        return "Removed the robot.";
      case "alarm_acknowledged":
        return `Saw alarm ${entry.code}${entry.comment ? `: “${entry.comment}”` : ""}.`;
      case "alarm_shelved":
        return `Shelved alarm ${entry.code}, because: “${entry.reason}”.`;
      case "alarm_unshelved":
        return `Took alarm ${entry.code} from the shelf.`;
      case "raw_rules":
        return `${count(entry.rules.length + entry.more, "rule holds", "rules hold")} for raw ports from now on.`;
      case "raw_ports":
        return entry.open ? "Opened the raw ports." : "Closed all raw ports.";
      case "settings_changed":
        return `Changed the settings of the hall: ${entry.time_zone}, ${count(entry.shifts.length, "shift", "shifts")}.`;
      case "program_stored":
        return `Stored program ${entry.program}, version ${entry.version}.`;
      case "program_removed":
        return `Removed program ${entry.program}.`;
      case "point_stored":
        return `Stored point ${entry.point}, version ${entry.version}.`;
      case "point_removed":
        return `Removed point ${entry.point}.`;
    }
  },
  chain: "Is the log whole?",
  chainWhat:
    "Each entry has a hash over itself and the entry before. The gateway signs the end of the log: the head. A page cannot prove that the log is whole, because it sees only what the gateway sends.",
  head: "Sign the end of the log now",
  headWhat: "Keep this head on another machine. It proves later that nothing up to this entry was cut off or rewritten.",
  headNumber: "Last entry",
  headTime: "Signed at",
  headHash: "Hash",
  headKey: "Key",
  save: "Save as a file",
  verify: "To check every entry, run this at the gateway, with a head and a key that were kept elsewhere:",
  kept: "Compare a head that was kept",
  keptHint: "The content of a file that was saved here or fetched from /v1/audit/head.",
  compare: "Compare",
  noHead: "This is no head: it has no number and no hash.",
  same: (number: number) =>
    `The gateway tells the same hash for entry ${number}. If it tells the truth, nothing up to there was rewritten. r6 gateway verify checks it.`,
  other: (number: number) =>
    `Entry ${number} has ANOTHER hash now. The log was rewritten, or this head is of another gateway. Keep the folder, and run r6 gateway verify.`,
  gone: (number: number) =>
    `Entry ${number} is not there, or you may not see it. Either the log was cut off, or the entry was old and was removed.`,
};
