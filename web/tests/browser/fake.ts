/**
 * A gateway that is none: it serves the page, and tells of hundreds of robots over `/v1/live`, ten times a second
 * or as fast as the page takes it. `fake.test.ts` compares its messages with those of a real gateway. What it does
 * is the same in each run.
 */
import { readFileSync } from "node:fs";
import { type IncomingMessage, type Server, type ServerResponse, createServer } from "node:http";
import type { AddressInfo } from "node:net";
import { extname, join } from "node:path";
import { fileURLToPath } from "node:url";
import type { Browser, BrowserContextOptions, Page } from "playwright-core";
import type {
  AddressValue,
  ArmModel,
  GatewayEvent,
  History,
  LiveSent,
  RobotAlarm,
  RobotAlarms,
  RobotState,
  RobotSummary,
  Session,
  Settings,
  Signal,
} from "../../src/api/types.ts";
import { PLAIN } from "../../src/route.ts";
import { SESSION_KEY } from "../../src/state/known.ts";
import { openPage } from "./support.ts";
import { Wire } from "./wire.ts";

/** As a gateway for development takes it. */
const BUILT = process.env["R6_PAGE"] ?? fileURLToPath(new URL("../../../crates/r6-gateway/page/built", import.meta.url));
const TYPES: Record<string, string> = { ".html": "text/html; charset=utf-8", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml" };

/** How often each robot is read, in milliseconds, and how often the gateway looks for changes. */
export const PERIOD = 100;
const PACE = 20;
const ALIVE = 2_000;
const EPOCH = 1_764_043_200_000_000;
const BEGIN = Date.UTC(2026, 10, 25, 6);
/** How many readings a cycle takes, and an alarm. */
const CYCLE = 180;
const ALARMED = 600;
const AXES = 6;
const MODEL = "BRTIRUS0707A";
const ALARM = { code: 135, text: "J6: positive soft limit", remedy: "Move the axis back in manual mode." };

type Happened = GatewayEvent extends infer Of ? (Of extends { id: number } ? Omit<Of, "id" | "robot" | "time"> : never) : never;
type Unit = string | null;

/** The values in the order of the gateway, with their units. */
const UNITS: readonly (readonly [string, Unit])[] = [
  ["curMode", null],
  ["curAlarm", null],
  ["isMoving", null],
  ["origin", null],
  ...Array.from({ length: AXES }, (_, at) => [`axis-${at}`, null] as const),
  ...Array.from({ length: AXES }, (_, at) => [`world-${at}`, at < 3 ? "mm" : "deg"] as const),
  ["RemoteCmdLen", null],
  ["curMold", null],
  ["curCycle", "s"],
  ["lastCycle", "s"],
  ["counter-0", null],
];
const UNIT = new Map(UNITS);

/** Numbers between 0 and 1, the same ones for the same seed (mulberry32). */
function random(seed: number): () => number {
  let state = seed;
  return () => {
    state = (state + 0x6d2b79f5) | 0;
    let mixed = Math.imul(state ^ (state >>> 15), 1 | state);
    mixed = (mixed + Math.imul(mixed ^ (mixed >>> 7), 61 | mixed)) ^ mixed;
    return ((mixed ^ (mixed >>> 14)) >>> 0) / 4_294_967_296;
  };
}

/** As many decimals as a controller sends. */
const rounded = (value: number): number => Math.round(value * 1e6) / 1e6;

class FakeRobot {
  readonly values = new Map<string, AddressValue>();
  link: "up" | "down" = "up";
  number = 1;
  alarm: RobotAlarm | null = null;
  private readings: number;
  private alarmed = 0;
  private cycles = 0;

  constructor(
    readonly name: string,
    private readonly at: number,
    public runs: boolean,
    private readonly isVirtual: boolean,
    private readonly behind: string,
  ) {
    this.readings = (at * 37) % CYCLE;
    const first: Record<string, AddressValue> = { curMode: runs ? 7 : 2, curAlarm: 0, isMoving: runs, origin: true, RemoteCmdLen: 0 };
    for (const [address] of UNITS) this.values.set(address, first[address] ?? 0);
    // This firmware does not tell it.
    if (behind === "") this.values.delete("curMold");
    else this.values.set("curMold", `pick${behind}`);
    this.values.set("counter-0", this.counter());
    this.values.set("lastCycle", 18);
    this.move();
  }

  /** Whether its next reading may differ from the last one. */
  get isBusy(): boolean {
    return this.runs || this.alarm !== null;
  }

  /** Another reading: what changed, and what happened. */
  read(time: number, number: number): { signals: Signal[]; events: Happened[] } {
    this.readings += 1;
    this.number = number;
    const [changed, events]: [string[], Happened[]] = [[], []];
    if (this.alarm !== null) {
      this.alarmed += 1;
      if (this.alarmed === ALARMED) {
        events.push({ event: "alarm_ended", code: ALARM.code, text: ALARM.text, lasted_ms: ALARMED * PERIOD }, this.mode(7));
        this.alarm = null;
        changed.push(...this.set({ curAlarm: 0, curMode: 7, isMoving: true }));
      }
      return { signals: this.signals(changed), events };
    }
    if (!this.runs) return { signals: [], events };
    changed.push(...this.move());
    if (this.readings % CYCLE === 0) {
      this.cycles += 1;
      const ms = CYCLE * PERIOD + (this.cycles % 7) * 20;
      changed.push(...this.set({ lastCycle: ms / 1_000, "counter-0": this.counter() }));
      events.push({ event: "cycle_done", count: 1, at_least: false, ms, at: new Date(time).toISOString() });
      events.push({ event: "parts", counter: "counter-0", added: 1, total: this.cycles });
    }
    return { signals: this.signals(changed), events };
  }

  /** An alarm begins. */
  fail(time: number, id: number): { signals: Signal[]; events: Happened[] } {
    const since = new Date(time).toISOString();
    const about = { axis: "J6", begin_seen: true, end_seen: false, acknowledged: null, shelved: null, until: null };
    const text = ALARM.text + this.behind;
    this.alarm = { id, robot: this.name, ...ALARM, text, ...about, since, state: "active" };
    this.alarmed = 0;
    const events: Happened[] = [{ event: "alarm_began", ...ALARM }, this.mode(3)];
    return { signals: this.signals(this.set({ curAlarm: ALARM.code, curMode: 3, isMoving: false })), events };
  }

  summary(): RobotSummary {
    return {
      name: this.name,
      address: `10.0.${Math.floor(this.at / 250)}.${(this.at % 250) + 1}:9760`,
      managed_by: "file",
      model: MODEL,
      link: this.link,
      identity: { firmware: "HC-QC-RX-7.8.07-master-F5.2.1", machine_name: (this.isVirtual ? `r6 virtual ${MODEL}` : MODEL) + this.behind, axis_count: AXES },
      identity_changed: null,
      virtual: this.isVirtual,
      panel: false,
      twin: null,
      guard: null,
      parts: null,
      twin_of: null,
      owner: null,
      lease: this.behind === "" ? null : { number: 1, holder: `op-1${this.behind}`, expires_in_ms: 60_000 },
      stopped: false,
      stopped_by: null,
      stops_under_way: 0,
      stop_number: 0,
      global_speed: null,
    };
  }

  state(): RobotState {
    return { ...this.summary(), period_ms: PERIOD, epoch: EPOCH, number: this.number, signals: this.signals(UNITS.map(([address]) => address)) };
  }

  private counter(): AddressValue {
    return { id: 0, current: this.cycles, target: 100_000 };
  }

  private mode(to: number): Happened {
    return { event: "mode_changed", from: Number(this.values.get("curMode")), to };
  }

  private set(values: Record<string, AddressValue>): string[] {
    for (const [address, value] of Object.entries(values)) this.values.set(address, value);
    return Object.keys(values);
  }

  /** Each axis goes to and fro. The pose is no pose of these axes: the page computes none. */
  private move(): string[] {
    const turn = ((this.readings % CYCLE) / CYCLE) * 2 * Math.PI;
    const values: Record<string, AddressValue> = { curCycle: rounded(((this.readings % CYCLE) * PERIOD) / 1_000) };
    for (let axis = 0; axis < AXES; axis += 1) {
      values[`axis-${axis}`] = rounded(20 * Math.sin(turn + axis + this.at));
      values[`world-${axis}`] = rounded(400 + 100 * Math.cos(turn + axis + this.at));
    }
    return this.set(values);
  }

  private signals(addresses: string[]): Signal[] {
    return addresses.map((address) => {
      const value = this.values.get(address) ?? null;
      const isRead = this.link === "up";
      if (value === null) return { address, value, unit: UNIT.get(address) ?? null, quality: "none", age_ms: null };
      return { address, value, unit: UNIT.get(address) ?? null, quality: isRead ? "fresh" : "stale", age_ms: isRead ? 24 : 61_000 };
    });
  }
}

export interface Wanted {
  robots: number;
  /** How many of them run a program: their axes move. */
  running: number;
  /** How many have no link. */
  lost?: number;
  /** How many have an alarm from the begin. */
  alarmed?: number;
  /** After how many readings of the hall another robot raises an alarm for a minute. */
  alarmEvery?: number;
  /** What stands behind all names and texts of robots. */
  behind?: string;
  /** The models of a real gateway: without them there is no picture of an arm. */
  models?: ArmModel[];
}

export class FakeGateway {
  readonly robots: FakeRobot[];
  url = "";
  /** How many messages were sent, of all connections. */
  sent = 0;
  /** How many passes of a live hall were left out because the page had not taken the one before. */
  behind = 0;
  private readonly server: Server;
  private readonly wires = new Set<Wire>();
  private readonly dice = random(7);
  private number = 1;
  private event = 0;
  private readings = 0;
  private timer: ReturnType<typeof setInterval> | null = null;

  constructor(private readonly wanted: Wanted) {
    const kinds = ["press", "pack", "saw", "weld", "lathe"];
    this.robots = Array.from({ length: wanted.robots }, (_, at) => {
      const name = `${kinds[Math.floor((at * kinds.length) / wanted.robots)]}-${String(at + 1).padStart(3, "0")}`;
      const { behind = "" } = wanted;
      return new FakeRobot(name + behind, at, at < wanted.running, at % 10 === 9, behind);
    });
    this.robots.sort((a, b) => (a.name < b.name ? -1 : 1));
    for (const robot of this.robots.slice(-(wanted.lost ?? 0) || Infinity)) robot.link = "down";
    for (let at = 0; at < (wanted.alarmed ?? 0); at += 1) this.robots[at * 3]?.fail(this.time, this.alarmId());
    this.server = createServer((request, response) => this.answer(request, response));
    this.server.on("upgrade", (request, stream) => this.open(new Wire(request, stream)));
  }

  /** The clock of the hall, in milliseconds since 1970. It goes on with the readings. */
  get time(): number {
    return BEGIN + this.readings * PERIOD;
  }

  async begin(): Promise<void> {
    await new Promise<void>((next) => this.server.listen(0, "127.0.0.1", next));
    this.url = `http://127.0.0.1:${(this.server.address() as AddressInfo).port}`;
  }

  async end(): Promise<void> {
    this.rest();
    for (const wire of this.wires) wire.end();
    this.server.closeAllConnections();
    await new Promise<void>((next) => this.server.close(() => next()));
  }

  /** Tells of each robot ten times a second, a fifth of them at a time, as a gateway that reads them does. */
  live(): void {
    const parts = PERIOD / PACE;
    let begun = performance.now();
    let pass = 0;
    this.timer = setInterval(() => {
      const now = performance.now();
      // A timer that comes late is made up for, but not by more than a busy machine can do.
      begun = Math.max(begun, now - PERIOD);
      for (; now - begun >= PACE; begun += PACE, pass += 1) {
        if (pass % parts === 0) this.readings += 1;
        const isSlow = [...this.wires].some((wire) => !wire.isDrained);
        if (isSlow) this.behind += 1;
        const texts = this.pass(this.robots.filter((_, at) => at % parts === pass % parts), pass % parts === 0);
        if (pass % (ALIVE / PACE) === 0) texts.push(this.alive());
        if (!isSlow) this.send(texts);
      }
    }, PACE / 2);
  }

  rest(): void {
    if (this.timer !== null) clearInterval(this.timer);
    this.timer = null;
  }

  /** Tells so many seconds of the hall, an even number, as fast as the page takes them. */
  async pour(seconds: number): Promise<void> {
    for (let at = 0; at < (seconds * 1_000) / ALIVE; at += 1) {
      const texts: string[] = [];
      for (let reading = 0; reading < ALIVE / PERIOD; reading += 1) {
        this.readings += 1;
        texts.push(...this.pass(this.robots.filter((robot) => robot.isBusy), true));
      }
      this.send([...texts, this.alive()]);
      await Promise.all([...this.wires].map((wire) => wire.drained()));
      // Requests of the page have their turn.
      await new Promise((next) => setImmediate(next));
    }
  }

  /** The messages of one look at these robots. The last one tells where to resume. */
  private pass(robots: FakeRobot[], mayFail: boolean): string[] {
    const sent: LiveSent[] = [];
    for (const robot of robots) {
      if (robot.link === "down") continue;
      this.tell(sent, robot, (number) => robot.read(this.time, number));
    }
    const every = this.wanted.alarmEvery ?? 0;
    if (mayFail && every > 0 && this.readings % every === 0) {
      const robot = this.robots[Math.floor(this.dice() * this.robots.length)];
      if (robot !== undefined && robot.link === "up" && robot.alarm === null) {
        this.tell(sent, robot, () => robot.fail(this.time, this.alarmId()));
      }
    }
    return this.texts(sent);
  }

  private tell(sent: LiveSent[], robot: FakeRobot, read: (number: number) => { signals: Signal[]; events: Happened[] }): void {
    const after = robot.number;
    const { signals, events } = read(this.number + 1);
    if (signals.length > 0) {
      this.number += 1;
      robot.number = this.number;
      sent.push({ type: "change", robot: robot.name, after, number: this.number, signals });
    } else robot.number = after;
    for (const one of events) {
      this.event += 1;
      const about = { type: "event", id: this.event, time: new Date(this.time).toISOString(), robot: robot.name } as const;
      sent.push({ ...about, ...one });
    }
  }

  private alarmId(): number {
    return EPOCH + this.event;
  }

  private alive(): string {
    return JSON.stringify({ type: "alive", time: new Date(this.time).toISOString(), passed_ms_ago: 0 } satisfies LiveSent);
  }

  private texts(sent: LiveSent[]): string[] {
    const last = sent.at(-1);
    if (last !== undefined) last.resume = `${EPOCH}-${this.number}-${this.event}`;
    return sent.map((one) => JSON.stringify(one));
  }

  private send(texts: string[]): void {
    if (texts.length === 0) return;
    for (const wire of this.wires) {
      if (!wire.isOpen) this.wires.delete(wire);
      else {
        wire.send(texts);
        this.sent += texts.length;
      }
    }
  }

  private open(wire: Wire): void {
    const texts = this.texts(this.robots.map((robot) => ({ type: "snapshot", ...robot.state() })));
    wire.send([...texts, this.alive()]);
    this.wires.add(wire);
  }

  private answer(request: IncomingMessage, response: ServerResponse): void {
    const { pathname, searchParams } = new URL(request.url ?? "/", "http://fake");
    // The page compares it with the time in the messages.
    response.setHeader("Date", new Date(this.time).toUTCString());
    const say = (value: unknown, status = 200): void => {
      response.writeHead(status, { "Content-Type": "application/json", "Cache-Control": "no-store" });
      response.end(JSON.stringify(value));
    };
    const [, robot] = /^\/v1\/robots\/([^/]+)$/.exec(pathname) ?? [];
    const found = this.robots.find(({ name }) => name === decodeURIComponent(robot ?? ""));
    const isHistory = /^\/v1\/robots\/[^/]+\/history$/.test(pathname);
    if (pathname === "/healthz") response.writeHead(204).end();
    else if (pathname === "/v1/session") say(SESSION);
    else if (pathname === "/v1/settings") say({ time_zone: "Europe/Berlin", shifts: [], managed_by: "file", etag: '"1"' } satisfies Settings);
    else if (pathname === "/v1/models") say({ models: this.wanted.models ?? [] });
    else if (pathname === "/v1/alarms") say({ alarms: this.alarms(), left_out: 0, not_known: [] } satisfies RobotAlarms);
    else if (pathname === "/v1/robots") say({ robots: this.robots.map((one) => one.summary()) });
    else if (found !== undefined) say(found.state());
    else if (isHistory) say(this.history(decodeURIComponent(pathname.split("/")[3] ?? ""), searchParams));
    else if (pathname.startsWith("/v1/")) say({ code: "no_such_path", message: "the fake gateway has no such path" }, 404);
    else this.file(pathname, response);
  }

  private alarms(): RobotAlarm[] {
    return this.robots.flatMap(({ alarm }) => alarm ?? []);
  }

  /** Nothing was recorded. */
  private history(robot: string, asked: URLSearchParams): History {
    const [from, to] = [asked.get("from") ?? "", asked.get("to") ?? ""];
    const signal = asked.get("signal") ?? "";
    const bucket = Number.parseInt(asked.get("bucket") ?? "1000", 10);
    const asIs = { robot, signal, unit: UNIT.get(signal) ?? null, from, to };
    return { ...asIs, bucket_ms: bucket, buckets: [], next_cursor: null, kept_until: null, unreadable_chunks: 0 };
  }

  private file(path: string, response: ServerResponse): void {
    const isPage = path === "/" || path.startsWith("/robots/") || PLAIN.some((page) => path === `/${page}`);
    const name = isPage ? "index.html" : path.slice(1);
    try {
      const bytes = readFileSync(join(BUILT, name));
      response.writeHead(200, { "Content-Type": TYPES[extname(name)] ?? "application/octet-stream" });
      response.end(bytes);
    } catch {
      response.writeHead(404).end();
    }
  }
}

const SESSION: Session = {
  csrf: "fake",
  ends_in_ms: 28_800_000,
  idle_ends_in_ms: 900_000,
  robot: null,
  role: "operator",
  token: 1,
  token_name: "fake",
  user: null,
};

/** A page in a browser that has a session at the fake gateway. Without one, the page does not ask for it. */
export async function openSignedIn(browser: Browser, options: BrowserContextOptions = {}): Promise<{ page: Page; faults: string[] }> {
  const opened = await openPage(browser, options);
  await opened.page.addInitScript((key) => {
    if (location.protocol === "http:") localStorage.setItem(key, "1");
  }, SESSION_KEY);
  return opened;
}
