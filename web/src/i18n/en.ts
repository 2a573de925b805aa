/** The words of the page in English. Another language is a file with the same fields: see zh.ts. */
import type { Role } from "../api/types.ts";
import type { Cause } from "../robots/attention.ts";
import type { Changed } from "../robots/consent.ts";
import type { Doing, Unmet } from "../robots/sentence.ts";
import { account } from "./en/account.ts";
import { connections } from "./en/connections.ts";
import { arm } from "./en/arm.ts";
import { controls } from "./en/controls.ts";
import { faults } from "./en/faults.ts";
import { alarms } from "./en/alarms.ts";
import { chart } from "./en/chart.ts";
import { choice, history } from "./en/history.ts";
import { menu } from "./en/menu.ts";
import { production } from "./en/production.ts";
import { count, duration } from "./en/say.ts";
import { hallSettings } from "./en/settings.ts";
import { ROLES } from "./en/rights.ts";
import { ui } from "./en/ui.ts";
import { UNMET } from "./en/unmet.ts";
import { run } from "./en/run.ts";
import { teach } from "./en/teach.ts";

const MODES: Record<number, string> = {
  0: "no mode",
  1: "manual",
  2: "at rest",
  3: "stopped",
  7: "running",
  8: "single step",
  9: "single cycle",
};

function named(program: string | null): string {
  return program === null ? "" : ` ${program}`;
}

function listOf(left: number | null): string {
  return left === null || left === 0 ? "" : `, ${count(left, "instruction", "instructions")} left in its list`;
}

export const en = {
  code: "en",
  name: "English",
  menu,
  ui,
  account,
  connections,
  hallSettings,
  arm,
  controls,
  run,
  faults,
  teach,
  alarms,
  chart,
  choice,
  history,
  production,
  hall: "Hall",
  toHall: "Back to the hall",
  main: "Main content",
  language: "Language",
  theme: "Colours",
  themes: { system: "As the system", light: "Light", dark: "Dark" },
  signIn: {
    title: "Sign in",
    name: "Name",
    password: "Password",
    token: "Token",
    withPassword: "Sign in with name and password",
    withToken: "Sign in with a token",
    submit: "Sign in",
    working: "Signing in…",
    signOut: "Sign out",
    ended: "The session has ended. Sign in again.",
    maybeOpen: "The gateway did not confirm it: the session may still be open. Try again.",
    open: (who: string) => `A session is open in this browser: ${who}.`,
    linkOf: (who: string) => `The link in the address signs in somebody else: ${who}.`,
    linkUnknown: "The link in the address is not valid, or the gateway does not answer.",
    keep: (who: string) => `Go on as ${who}`,
    replace: (who: string) => `End that session and sign in as ${who}`,
    hint: "The command r6 up prints a link that signs in. The command r6 gateway token makes tokens. An admin makes users.",
    badLink: "The link in the address has no valid token. The link of an earlier start is not valid any more.",
    problem: (code: string, message: string) =>
      code === "wrong_password"
        ? "The name or the password is wrong, or the user is disabled."
        : code === "no_token"
          ? "This token is not valid."
          : code === "too_many_requests"
            ? "Too many tries. Wait, then try again."
            : code === "unknown"
              ? "The gateway does not answer. Try again."
              : message,
  },
  role: (role: Role) => ROLES[role],
  token: (number: number) => `token ${number}`,
  gateway: {
    ms: (ms: number) => `gateway ${ms} ms`,
    connecting: "Connecting to the gateway…",
    lost: (seconds: number) =>
      `No connection to the gateway for ${duration(seconds)}. Everything on this page is old. Trying again…`,
    hangs: (seconds: number) =>
      `Nothing was heard of the gateway for ${duration(seconds)}, and the connection did not end: the gateway or the network hangs. Everything on this page is old. Trying again…`,
    lostShort: "gateway lost",
    silent: "gateway silent",
    ageUnknown: "not known how old the values are",
    slow: (seconds: number) => `gateway slow: values are up to ${Math.max(1, Math.ceil(seconds))} s old`,
  },
  mode: (mode: number | null) => (mode === null ? "mode unknown" : (MODES[mode] ?? `mode ${mode}`)),
  zoneUnread: "The time zone of the hall is not known yet. Times are in UTC.",
  zoneUnknown: (zone: string) => `This browser does not know the time zone of the hall, ${zone}. All times on this page are in UTC.`,
  virtual: "VIRTUAL 虚拟",
  real: "real",
  kindUnknown: "kind unknown",
  counts: {
    need: (n: number) => (n === 0 ? "no robot needs a person" : count(n, "needs a person", "need a person")),
    unknown: (n: number) => `${n} unknown`,
    noLink: (n: number) => `${n} no link`,
    run: (n: number) => count(n, "runs", "run"),
    rest: (n: number) => `${n} at rest`,
    manual: (n: number) => `${n} in manual`,
    twins: (n: number) => count(n, "twin", "twins"),
  },
  needs: {
    title: "Needs a person",
    none: "No robot needs a person.",
    old: "The gateway is not heard. What needs a person now is not known.",
    unknown: (n: number) =>
      `Of ${count(n, "robot", "robots")} it is not known whether a person is needed: the values are missing, old, or read too seldom.`,
    waiting: (n: number) => `${n} new`,
    shelved: (n: number) => count(n, "alarm is shelved", "alarms are shelved"),
    open: "Open",
    priority: (n: 1 | 2): string => (n === 1 ? "needs a person" : "impaired"),
    since: (seconds: number) => `waits ${duration(seconds)}`,
    cause: (cause: Cause, robots: number) => {
      switch (cause.kind) {
        case "alarm":
          return `alarm ${cause.code}${cause.text === null ? "" : `: ${cause.text}`}`;
        case "other_robot":
          return "another robot answers at this address; an engineer has to accept it";
        case "no_link":
          return robots === 1 ? "link lost" : `link lost: ${robots} robots`;
        case "stop_holds":
          return `a stop${cause.by === null ? "" : ` of ${cause.by}`} holds until a person takes control and clears it`;
        case "runs_although_stopped":
          return "runs although a stop holds: it holds back what comes through the gateway, not the machine's own buttons";
      }
    },
    acknowledged: (by: string) => `seen by ${by}`,
  },
  robots: {
    title: "All robots",
    found: (n: number, twins: number) => (twins === 0 ? `${n}` : `${n - twins}, ${count(twins, "twin", "twins")}`),
    search: "Search robots",
    none: "No robot yet. An admin adds one on the page of connections, or in the file of the gateway.",
    noMatch: (search: string) => `No robot matches “${search}”.`,
    loading: "Waiting for the robots…",
    noLinkThen: (seconds: number) => `had no link, ${duration(seconds)} old`,
    noLink: (seconds: number | null) => (seconds === null ? "no link" : `no link ${duration(seconds)}`),
    alarm: (code: number) => `alarm ${code}`,
    parts: (n: number) => `counter ${n}`,
    stands: (seconds: number) => `stands, ${duration(seconds)} or more`,
    old: (seconds: number) => `${duration(seconds)} old`,
    held: (holder: string) => `${holder} controls it`,
    stopHolds: "stop holds",
    moves: "moves",
  },
  doing: (doing: Doing) => {
    switch (doing.kind) {
      case "no_link":
        return "The gateway has no link to this robot. What it does is not known.";
      case "other_robot":
        return `Another robot answers at this address${doing.found === null ? "" : `: ${doing.found}`}. Commands are refused until an engineer accepts it.`;
      case "not_read":
        return "Its state was not read yet.";
      case "alarm":
        return `Alarm ${doing.code}${doing.text === null ? "" : `: ${doing.text}`}. It waits for a person.`;
      case "stop_holds":
        return `${doing.stands ? "A stop holds, and the arm stands." : "A stop holds; whether the arm stands is not known."} ${
          doing.mine ? "It waits for you to clear the stop." : "It waits until a person in control clears the stop."
        }`;
      case "manual":
        return "Manual: the person at the pendant leads. Commands from here are refused.";
      case "moves":
        return `The arm moves${doing.program === null ? "" : `, program${named(doing.program)}`}${listOf(doing.left)}.`;
      case "runs":
        if (!doing.stands) {
          return `The program${named(doing.program)} runs${listOf(doing.left)}. Whether the arm moves now is not known.`;
        }
        return doing.left !== null && doing.left > 0
          ? `The program${named(doing.program)} runs${listOf(doing.left)}. The arm stands now.`
          : `The program${named(doing.program)} runs. The arm stands, and waits for a signal or for instructions.`;
      case "waits_for_start":
        return doing.stands
          ? "At rest in automatic mode. It waits for a start."
          : "In automatic mode, and no program runs. Whether the arm stands is not known.";
      case "stopped":
        return doing.stands
          ? "Stopped. It waits for a person who turns its key to automatic, at the pendant. Then it can be started here."
          : "Its mode is “stopped”. Whether the arm stands is not known.";
      case "unknown_mode":
        return `In mode ${doing.mode}, which this page does not know.`;
    }
  },
  unmet: (reason: Unmet) => UNMET[reason],
  lease: {
    take: "Take control",
    taking: "Taking control…",
    give: "Give back",
    mine: (left: string) => `You control it, ${left}`,
    others: (holder: string) => `${holder} controls it`,
    free: "Nobody controls it",
    unknown: "Who controls it is not known",
    ended: "Your control has ended.",
  },
  control: {
    title: "Control",
    pause: "Pause",
    clearAlarm: "Clear alarm",
    clearStop: "Clear stop",
    prepare: "Prepare start…",
    run: (robot: string) => `Hold to run ${robot}`,
    runHint: "Hold the button for 1 s.",
    runKeys: "Or press Enter twice on it.",
    cancel: "Cancel",
    close: "Close",
    prepareTitle: (robot: string) => `Start ${robot}?`,
    prepareWhat: (program: string | null) =>
      program === null ? "The controller runs its program." : `The controller runs its program ${program}.`,
    prepareLeft: (left: number | null) =>
      left === null
        ? "Whether instructions are left in its list is not known. If there are, they run too."
        : left === 0
          ? "No instruction is left in its list."
          : `${count(left, "instruction is", "instructions are")} left in its list. They run too.`,
    prepareSpeed: "The controller does not report its global speed. Expect full speed.",
    preparePerson: "Look at the arm: nobody may be near it.",
    changed: (what: Changed) =>
      `Not started: ${{
        robot: "another robot may answer now, or it is told anew what it is",
        program: "the program is another one now, or is not known any more",
        left: "what is left in its list has changed, or is not known any more",
        speed: "the global speed is another one now, or is not known any more",
      }[what]}. Prepare it again.`,
    becameUnready: "It cannot be started now:",
    sending: (what: string) => `${what}: sending…`,
    /** An alarm came after the start. */
    startAlarm: (code: number) => `Start: accepted. Within half a minute alarm ${code} came: see above.`,
    accepted: (what: string) => `${what}: accepted. The values show whether it moves.`,
    alarmTaken: (what: string) =>
      `${what}: the controller accepted it. An alarm whose cause is still there stays or comes back: look at the alarms.`,
    done: (what: string) => `${what}: done.`,
    refused: (what: string, message: string) => `${what}: refused. ${message}`,
    /** The gateway could not use the robot. `isSilent`: it is seen that the robot does not answer now. */
    notReady: (what: string, isSilent: boolean, said: string) =>
      `${what}: nothing was sent. ${
        isSilent ? "The gateway waits for an answer of the robot." : "The gateway may wait for an answer of the robot."
      } Try again in a moment. Gateway: ${said}`,
    unknown: (what: string) =>
      `${what}: OUTCOME UNKNOWN. The robot may have acted. Look at it, and stop it if in doubt. It is not sent again.`,
    start: "Start",
    lease: "Control",
    /** The gateway says what to do, too. */
    alarmRefused: (what: string, said: string, hasPanel: boolean) =>
      `${what}: ${said}.${hasPanel ? " The panel of this virtual robot is its pendant." : ""}`,
    startRefused: (what: string, said: string) =>
      `${what}: the controller refused it. It starts in automatic mode, without an alarm, with the emergency stop released: look at the pendant. Gateway: ${said}`,
  },
  stop: {
    one: (robot: string) => `STOP ${robot}`,
    many: "STOP…",
    open: "Choose what to stop",
    all: (n: number) => `Hold to stop all ${n}`,
    others: "Robots that are not seen to move can be stopped too.",
    every: (n: number) => `Hold to stop every robot (${n})`,
    none: "No robot moves.",
    unknown: "Which robots move is not known.",
    moving: "Robots that run, or may move",
    dismiss: "Seen",
    dismissOf: (robot: string) => `Seen ${robot}`,
    not: "Not an emergency stop",
    key: "F9",
    of: (robot: string, text: string) => `${robot}: ${text}`,
    waiting: "waits to be sent",
    sending: "sending",
    stopped: (at: string) => `stopped, seen ${at}`,
    notConfirmed: "NOT CONFIRMED. Use the emergency stop at the robot.",
    notSent: "NOT SENT. Use the emergency stop at the robot.",
    why: (why: string) =>
      ({
        no_answer: "No answer yet.",
        no_gateway: "The gateway cannot be reached.",
        in_turn: "It waits for the stops of other robots.",
        given_up: "It gave way to the stop of another robot.",
        cleared: "It was cleared since.",
        not_allowed: "You have no right to stop it.",
        no_session: "You are signed out.",
        no_token: "You are signed out.",
        not_stopped: "It is not proved that the arm stands.",
      })[why] ?? `(${why})`,
  },
  robot: {
    missing: (name: string) => `There is no robot “${name}”, or you may not see it.`,
    lastKnown: "Last known:",
    alsoStop: "A stop holds.",
    upTo: (seconds: number) => `up to ${duration(seconds)} old`,
    axes: "Axes",
    axis: "Axis",
    pose: "Pose",
    position: "Position",
    values: "Other values",
    value: "Value",
    age: "Age",
    now: "now",
    io: "Inputs and outputs",
    on: "On",
    off: "Off",
    notRead: "Nothing was read yet.",
    ioPaused: "Not read while nobody uses this page.",
    ioFailed: (message: string) => `They cannot be read: ${message}`,
    alarms: "Alarms",
    alarmsUnknown: "The alarms of now are not known.",
    noAlarms: "No alarm in the last day.",
    unseen: "last seen",
    facts: "About this robot",
    address: "Address",
    firmware: "Firmware",
    machine: "Machine name",
    model: "Model",
    modelUnknown: "not configured",
    every: "Read every",
    unknown: "unknown",
    yes: "yes",
    no: "no",
    signals: {
      curMode: "Mode",
      curAlarm: "Alarm",
      isMoving: "Moves",
      origin: "Homed",
      RemoteCmdLen: "Instructions left",
      curMold: "Program",
      curCycle: "Present cycle",
      lastCycle: "Last cycle",
    } as Record<string, string>,
  },
  error: {
    page: "This part of the page failed.",
    again: "Load the page again",
  },
  notThere: "There is no such page.",
};
