/** Words of the connections: robot, network or gateway, which is at fault. */
import type { Fault, Since } from "../../pages/connections/link.ts";

function few(robots: readonly string[]): string {
  return robots.length <= 5 ? robots.join(", ") : `${robots.slice(0, 5).join(", ")} and ${robots.length - 5} more`;
}

export const connections = {
  title: "Where is the fault?",
  fault: (fault: Fault): string => {
    switch (fault.kind) {
      case "none":
        return "No fault is seen: the gateway is heard, and each robot answers it.";
      case "no_robot":
        return "The gateway has no robot that you may see.";
      case "gateway":
        return "This page does not hear the gateway. Look at the gateway and at the network between it and this device. What the robots do is not known here.";
      case "all":
        return `None of the ${fault.robots.length} robots answers the gateway. Look at the network of the gateway first: its cable, its switch, its address.`;
      case "some":
        return `Others answer the gateway, but not: ${few(fault.robots)}. Look at ${fault.robots.length === 1 ? "this robot, its cable and its address" : "these robots, their cables and switches and their addresses"}.`;
      case "only":
        return `${few(fault.robots)} does not answer the gateway. It is the only robot: whether the robot or the network is at fault cannot be told from here. Look at both.`;
    }
  },
  page: "This page to the gateway",
  heard: (ms: number | null) => (ms === null ? "heard" : `heard, ${ms} ms there and back`),
  notHeard: "not heard",
  connecting: "connecting",
  store: "Disk of the gateway",
  storeOk: "can be written",
  storeBad: "CANNOT BE WRITTEN: commands are refused, stops are not",
  history: "History",
  historyIs: { kept: "is kept", paused: "PAUSED: the disk takes no samples", off: "off" },
  historySize: (mb: string) => `${mb} MB on the disk`,
  certificate: "Certificate ends",
  robotsUp: "Robots with a link",
  upOf: (up: number, all: number) => `${up} of ${all}`,
  robots: "Robots",
  none: "No robot yet. An admin of all robots adds one below, or in the file of the gateway.",
  robot: "Robot",
  link: "Link",
  up: "up",
  down: "NO LINK",
  unknown: "not known",
  since: "Since",
  sinceIs: (since: Since, at: string): string =>
    ({ unknown: "not known", at, at_least: `${at} or earlier`, no_change: "no change recorded, as far as the last 24 h are kept" })[since.kind],
  losses: "Losses in 24 h",
  timeouts: "Without a reply",
  timeoutsOf: (timeouts: number, requests: number) => `${timeouts} of ${requests}`,
  reconnects: "Reconnects",
  countedSince: "Counts begin when the gateway starts or the robot is added or changed. The gateway does not tell how long a reply takes.",
  machine: "Machine, firmware",
  every: "Read every",
  details: "Details",
  address: "Address",
  axes: "Axes",
  model: "Model",
  managed: "Managed by",
  managedBy: { file: "the file or the command line of the gateway: change it there", api: "this page and the API" },
  twin: "Its twin",
  twinOf: "Is the twin of",
  raw: "Clients of the raw port",
  rawRefused: "Raw requests answered with err",
  rawClosed: "Raw clients closed",
  lost: "Samples lost",
  waiting: "Records that wait for the disk",
  replies: "Replies",
  read: "Read besides the usual",
  events: "Link in the last 24 h",
  noEvents: "It was neither lost nor found again.",
  event: { link_lost: "lost", link_back: "back" } as Record<string, string>,
  changed: (robot: string) => `${robot}: another robot answers at this address`,
  changedWhat: "Commands are refused until an engineer accepts the robot that answers.",
  expected: "Expected",
  found: "Answers now",
  firmware: "Firmware",
  name: "Machine name",
  accept: "Accept the robot that answers…",
  acceptTitle: (robot: string) => `Is this ${robot} from now on?`,
  acceptWhat:
    "Stand at the machine, and compare its name and firmware with what is shown here. Commands and programs for this name go to this machine from then on.",
  acceptVoid: "Nothing was accepted: what was shown is not what answers now, or the gateway is not heard. Look again.",
  acceptNow: "Accept it",
  didAccept: (robot: string) => `Accept the robot that answers as ${robot}`,
  add: "Add a robot",
  addHint: "a to z, digits and -; 32 characters at most",
  badName: "This name is not allowed.",
  nameTaken: "There is a robot of this name already. Change it in the list.",
  addressHint: "Host, and the port if it is not 9760; or listen:ADDR:PORT,from:ADDR",
  period: "Read every (ms)",
  periodHint: "20 to 3600000",
  badPeriod: "A number from 20 to 3600000.",
  readHint: "Query addresses with commas between them, such as Addr-800, counter-0. The first counter counts parts.",
  modelHint: "Such as BRTIRUS0707A: for the picture, plans and limits. Leave it empty if it is not known.",
  didAdd: (robot: string) => `Add ${robot}`,
  change: "Change…",
  changeTitle: (robot: string) => `Change ${robot}`,
  changeWhat: "The robot gets a new connection, and its lease ends. A program that runs is stopped first.",
  readDerived: "This list was made of the values that are read now. Check it.",
  didChange: (robot: string) => `Change ${robot}`,
  remove: "Remove…",
  removeTitle: (robot: string) => `Remove ${robot}?`,
  removeWhat:
    "Its lease ends, and the arm goes on with what it does. A program that the gateway runs is stopped first. A robot at which a stop holds is not removed.",
  didRemove: (robot: string) => `Remove ${robot}`,
  needsAdmin: "An admin of all robots adds and removes robots.",
};
