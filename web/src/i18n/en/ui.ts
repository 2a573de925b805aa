/** Words of the parts that pages share: see src/ui/. */
import type { Failure } from "../../api/failure.ts";
import type { Role } from "../../api/types.ts";
import type { Found } from "../../state/build.svelte.ts";
import { ROLES, rights, robotsOf } from "./rights.ts";

export const ui = {
  newBuild: "The gateway has another version of this page. What you typed and did not save is lost when it is loaded.",
  part: {
    failed: "This part of the page could not be loaded.",
    why: (found: Found) =>
      ({
        away: "The gateway does not answer. It is asked again when it is heard.",
        same: "The gateway answers now.",
        other: "The gateway has another version of this page, and not the parts of this one any more.",
      })[found],
  },
  loading: "Loading…",
  again: "Try again",
  /** What a press of a button that has to be held lacks. */
  lacks: { longer: "Hold it for 1 s.", again: "Press once more." },
  asOf: (at: string) => `As of ${at}. It may have changed since.`,
  /** What is wrong, in a sentence. The gateway's own message stands behind it. */
  problem: (code: Failure["code"]): string => {
    switch (code) {
      case "no_answer":
        return "The gateway does not answer.";
      case "not_allowed":
        return "You have no right to do this.";
      case "no_session":
      case "no_token":
        return "You are signed out.";
      case "too_many_requests":
        return "Too many requests at once.";
      case "overloaded":
        return "The gateway has too much to do.";
      case "store_unavailable":
        return "The gateway cannot use its disk.";
      case "outcome_unknown":
        return "Whether it was done is not known.";
      case "managed_by_file":
        return "The file of the gateway has this. It cannot be changed here.";
      case "not_this_version":
        return "Somebody else changed it meanwhile.";
      case "bad_value":
      case "bad_body":
        return "A value is not allowed.";
      case "no_such_robot":
        return "There is no such robot.";
      case "stopped":
        return "A stop holds at this robot.";
      case "address_taken":
        return "Another robot has this address.";
      case "name_taken":
        return "This name is taken.";
      case "last_admin":
        return "This is the last admin who can sign in.";
      case "wrong_password":
        return "The password is wrong.";
      case "link_void":
        return "The link is not valid any more.";
      case "no_room":
        return "There is no room for more.";
      case "no_such_user":
        return "There is no such user.";
      case "no_such_token":
        return "There is no such token.";
      default:
        return "The gateway refused it.";
    }
  },
  /** What to do next; empty if the message says it. */
  next: (code: Failure["code"]): string => {
    switch (code) {
      case "no_answer":
        return "Check that the gateway runs and that this device has a network.";
      case "not_allowed":
        return "Ask an admin for the role.";
      case "no_session":
      case "no_token":
        return "Sign in again.";
      case "too_many_requests":
      case "overloaded":
        return "Wait a moment.";
      case "store_unavailable":
        return "Look at the disk of the gateway: is it full, is it there?";
      case "outcome_unknown":
        return "Look at what is there now before you do it again.";
      case "managed_by_file":
        return "Change the file. A gateway that runs as a service reads it again with SIGHUP. A cell, which the command r6 up runs, has to be started again.";
      case "not_this_version":
        return "Look at the present values, then change them again.";
      case "last_admin":
        return "Make another admin first.";
      case "stopped":
        return "Look at the robot and clear the stop first.";
      case "link_void":
        return "Ask an admin for another link.";
      default:
        return "";
    }
  },
  /** Why something was refused, in a text of its own: what the gateway says, with its code for those who look it up. */
  refusal: ({ code, message }: Failure, withCode = true): string =>
    message === "" ? ui.problem(code) : withCode ? `${message} (${code})` : message,
  original: "The gateway's own words",
  said: "Gateway:",
  needsRole: (role: Role, ofAll: boolean) =>
    `This needs the role ${ROLES[role]}${role === "admin" ? "" : " or a higher one"}${ofAll ? ", for all robots" : ""}.`,
  haveRole: (role: Role, robot: string | null) =>
    `You are signed in as ${robot === null ? ROLES[role] : rights(role, robot)}. Ask an admin.`,
  scrolls: "There is more at the side: scroll sideways, or use the arrow keys. ↔",
  details: "Details",
  copy: "Copy",
  copied: "Copied",
  copyFailed: "Could not be copied. Select the text and copy it yourself.",
  once: "This is shown once. The gateway cannot show it again.",
  close: "Close",
  cancel: "Cancel",
  save: "Save",
  sending: "sending…",
  saving: "Saving…",
  saved: "Saved.",
  done: "Done.",
  yes: "yes",
  no: "no",
  allRobots: "all robots",
  robots: robotsOf,
  required: "required",
};
