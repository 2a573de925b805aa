/** The page of a robot: what a person does there. */
import type { CommandEnd, Deed } from "../../robots/around.ts";
import { RUN_ENDS } from "./run.ts";
import { count, duration } from "./say.ts";

const OUTCOMES: Record<CommandEnd, string> = {
  accepted: "accepted by the controller",
  refused: "refused",
  not_sent: "not sent",
  unknown: "OUTCOME UNKNOWN",
};

const LEASE_ENDS: Record<Extract<Deed, { event: "lease_ended" }>["cause"], string> = {
  released: "given back",
  expired: "not renewed",
  taken: "taken by an admin",
  identity_changed: "another robot answers",
  reconfigured: "the robot was changed",
  removed: "the robot was removed",
  gateway_ended: "the gateway ended",
  owner_changed: "another gateway has the robot, or the database did not answer",
};

/** What was done over the gateway. `outcome`: of a command. */
function deed(of: Deed, outcome: CommandEnd | null): string {
  switch (of.event) {
    case "lease_began":
      return `${of.holder} took control`;
    case "lease_ended":
      return `Control of ${of.holder} ended: ${LEASE_ENDS[of.cause]}`;
    case "stop_began":
      return `Stop by ${of.by}`;
    case "stop_ended":
      return of.confirmed ? "Stop: done, as asked" : "Stop: NOT CONFIRMED";
    case "stop_cleared":
      return "The stop was cleared";
    case "command_began":
      return `Command ${of.command}${outcome === null ? "" : `: ${OUTCOMES[outcome]}`}`;
    case "run_began":
      return `Run of ${of.program ?? "a program"} began: ${count(of.steps, "step", "steps")}`;
    case "run_ended":
      return `Run ended (${RUN_ENDS[of.because]}): ${count(of.done, "step", "steps")} seen to be done`;
    case "global_speed":
      return of.set === null ? "Which global speed is set is not known any more" : `Global speed ${of.set.percent} %, set by ${of.set.by}`;
    case "alarm_acknowledged":
      return `Alarm ${of.code} seen by ${of.by}`;
    case "alarm_shelved":
      return `Alarm ${of.code} shelved by ${of.by}`;
    case "alarm_unshelved":
      return `Alarm ${of.code} taken off the shelf`;
    case "identity_changed":
      return "Another robot answers";
    case "identity_accepted":
      return "The robot that answers was accepted";
    case "robot_changed":
      return "The address of the robot, or what is read of it, was changed";
  }
}

export const controls = {
  around: {
    title: (code: number) => `The minute before and after alarm ${code}`,
    show: "What happened around it",
    showOf: (code: number, at: string) => `What happened around it: alarm ${code}, ${at}`,
    offset: (seconds: number) =>
      Math.abs(seconds) < 0.05
        ? "at the alarm"
        : `${Math.abs(seconds) < 10 ? `${Math.abs(seconds).toFixed(1)} s` : duration(Math.abs(seconds))} ${seconds < 0 ? "before" : "after"}`,
    what: "Mode, program, alarms and link as they were read; control, commands, stops and runs over this gateway. Inputs and outputs are not kept.",
    deedsSince: (at: string) => `What was done before ${at} is not among the last events of the gateway.`,
    log: "Audit log of this time",
    deed,
  },
  parts: "Parts of this page",
  tabs: { live: "Live", axes: "Axes", io: "I/O", charts: "Charts", more: "More" },
  taken: (what: string) => `${what}: the controller accepted it.`,
  limits: "Soft limits",
  limitsOf: (low: number, high: number) => `${low} to ${high}`,
  nearness: { near: "near a limit", beyond: "beyond its limit" },
  stoppedBy: (by: string, at: string) => `Stopped by ${by}, ${at}`,
  stopNotProved: "It was not proved that the arm stood.",
  cleared: "The stop is cleared.",
  twin: "Twin",
  twinOf: "Twin of",
  speed: "Global speed",
  speedSet: (percent: number, by: string, at: string) =>
    `${percent} %, set by ${by}, ${at}; not reported by the controller`,
  speedOfPanel: (percent: number) => `${percent} %, as the panel of this virtual robot says`,
  speedOfPanelSet: (percent: number, by: string, at: string) =>
    `${percent} %, set by ${by}, ${at}; the panel of this virtual robot says the same`,
  speedUnknown: "Not known: the controller does not report it, and whether it is as it was last set is not known either.",
  percent: "Percent of full speed",
  setSpeed: (robot: string) => `Set the speed of ${robot}`,
  badPercent: "Above 0 to 100, in steps of 0.1.",
  raiseTitle: (robot: string, percent: number) => `Set ${robot} to ${percent} %?`,
  raise: (from: number | null, to: number) =>
    from === null
      ? `What the speed is now is not known. ${to} % may be faster.`
      : `It was ${from} %. What moves then moves faster, also a move that is under way.`,
  speedNotSet: (why: string) =>
    `The speed was not set: ${why === "" ? "the speed or the robot is another one now" : why}. Give it again.`,
  raiseDo: (robot: string, percent: number) => `Set ${robot} to ${percent} %`,
  motors: "Motors",
  motorSpeed: "Speed, RPM",
  torque: "Torque, % of rated",
  noMotors: "This controller does not tell speed and torque of its motors.",
  outputs: "Set an output",
  output: "Output or M point",
  outputNumber: "output",
  outputHint: "What is wired to an output may start to move.",
  setOn: (point: string) => `${point} on`,
  setOff: (point: string) => `${point} off`,
  further: (on: number) => `Further points, with their numbers: ${on === 0 ? "none is on" : `${on} on`}`,
  mPoints: (from: string, to: string) => `M points ${from} to ${to}`,
  inputsOf: (from: string, to: string) => `Inputs ${from} to ${to}`,
  outputsOf: (from: string, to: string) => `Outputs ${from} to ${to}`,
  numbers: "Counters and registers",
  counter: "Counter",
  register: "Register (800 to 900)",
  read: "Read",
  readAt: (at: string) => `read ${at}`,
  counterIs: (current: number, target: number, name: string) =>
    `${current}, target ${target}${name === "" ? "" : `, ${name}`}`,
  noValue: "The controller has no such value.",
  newCount: "New count",
  newValue: "New value",
  setCounter: (id: number) => `Set counter ${id}`,
  setRegister: (id: number) => `Write register ${id}`,
  wholeNumber: "A whole number.",
  registerHint: "A program of the cell may start a motion by a register.",
  take: "Take over…",
  takeTitle: (robot: string, holder: string) => `Take ${robot} from ${holder}?`,
  takeChanged: (before: string, now: string | null) =>
    `${before} does not control it any more: ${now === null ? "it is free" : `${now} does`}. Cancel, and ask again.`,
  takeWhat: "The gateway stops the robot first, and the stop holds. A program that it runs ends.",
  takeReason: "Reason, for the audit log",
  takeDo: (robot: string) => `Stop ${robot} and take control`,
  needsEngineer: "this needs the role engineer",
  run: "Run a program",
  runNone: "The gateway keeps no program yet. An engineer stores one on the page “Teach”, or with PUT /v1/programs/NAME.",
  lookAgain: "Look again",
  teach: "Teach a program",
  program: "Program",
  choose: "Choose…",
  cannotRun: { mistakes: "has mistakes", no_step: "no step yet", taught: "runs on a controller only" },
  repeat: "Times",
  badRepeat: "1 to 1000.",
  planEnds: "The plan does not come to its end:",
  problems: {
    limit: "a soft limit",
    out_of_reach: "out of reach",
    singular: "a singular position",
    alarm: "an alarm",
    waiting: "it waits for a signal that nothing sets in a plan",
    no_end: "it does not end",
    passed_over: "the controller does not carry it out",
  },
  step: (step: number | null) => (step === null ? "" : `step ${step}: `),
  panel: "Panel of the virtual robot",
  panelWhat: "What a person does at the machine: a real robot has no such panel.",
  panelOld: (seconds: number) => `${duration(seconds)} old`,
  panelPaused: "Not read while nobody uses this page.",
  panelFailed: (message: string) => `The panel cannot be read: ${message}`,
  panelIs: (mode: string, percent: number) => `${mode}, global speed ${percent} %`,
  panelProgram: "Program",
  emergency: "Press the emergency stop",
  emergencyIs: "The emergency stop is pressed.",
  release: "Release it",
  clearAlarm: "Clear alarm",
  key: "Mode key",
  keys: { manual: "Manual", auto: "Auto", stop: "Stop" },
  buttons: { start: "Start", stop: "Stop", pause: "Pause", single_cycle: "Single cycle", single_step: "Single step" },
  hold: (what: string) => `Hold: ${what}`,
  panelStop: "Button Stop",
  panelPause: "Button Pause",
  input: "Input",
  inputsOn: (names: string) => `On: ${names}`,
  inputsNone: "No input is on.",
  faults: "Alarm number",
  raise_alarm: "Raise it",
  badAlarm: "1 to 10000.",
  jog: "Move by hand",
  jogNeeds: "turn the mode key to Manual first",
  jogHold: "Hold a button: the axis moves until it is let go. It also stops when this page is hidden or loses the gateway.",
  jogSteps: "Or move by steps:",
  jogStep: "Step",
  jogBy: (axis: string, by: string) => `${axis} ${by}`,
  jogSpeed: "Speed, percent",
  home: "Move all axes to 0",
  switch: "Choose it",
  panelDid: (what: string) => `${what}: the panel took it.`,
};
