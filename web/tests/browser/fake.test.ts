/** The fake gateway says what a real one says: the same members, of the same types, with the same units. */
import type { Browser } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import type { LiveSent } from "../../src/api/types.ts";
import { decode } from "../../src/live/decode.ts";
import { FakeGateway, openSignedIn } from "./fake.ts";
import { type Made, make } from "./made.ts";
import { r6, startBrowser, until } from "./support.ts";

/** A cycle of about a second, and a part in each. */
const PROGRAM = `
[[step]]
do = "axis-move"
to = [10, 0, 0, 0, -10, 0]
speed = 60

[[step]]
do = "axis-move"
to = [-10, 0, 0, 0, 10, 0]
speed = 60

[[step]]
do = "counter"
number = 0
by = 1
`;

let made: Made;
let fake: FakeGateway;
let token = "";
let browser: Browser;

beforeAll(async () => {
  made = await make({ names: ["press-01"], program: PROGRAM, more: "" });
  token = await made.token("viewer");
  fake = new FakeGateway({ robots: 2, running: 1, lost: 1, alarmEvery: 400 });
  await fake.begin();
});

afterAll(async () => {
  await browser?.close();
  await fake?.end();
  await made?.end();
});

/** What a gateway tells, by a name for each kind of message; values of robots by their addresses. */
class Told {
  readonly kinds = new Map<string, unknown>();
  private readonly socket: WebSocket;

  constructor(url: string) {
    // The types are those of browsers, which cannot send a token.
    const Socket = WebSocket as unknown as new (url: string, options: object) => WebSocket;
    const headers = { Authorization: `Bearer ${token}` };
    this.socket = new Socket(`${url.replace(/^http/, "ws")}/v1/live?events=true&alive=true`, { headers });
    this.socket.addEventListener("message", ({ data }) => {
      const sent = decode(String(data));
      if (sent !== null) this.take(sent);
    });
  }

  private take(sent: LiveSent): void {
    // Only some messages say where to resume: see `resume` below.
    const { resume, ...message } = sent;
    if (resume !== undefined) this.kinds.set("resume", resume);
    if (message.type === "snapshot" || message.type === "change") {
      for (const signal of message.signals) if (signal.quality !== "stale") this.kinds.set(signal.address, signal);
      this.kinds.set(message.type, { ...message, signals: [] });
    } else this.kinds.set(message.type === "event" ? message.event : message.type, message);
  }

  has(...kinds: string[]): boolean {
    return kinds.every((kind) => this.kinds.has(kind));
  }

  close(): void {
    this.socket.close();
  }
}

/** The types of the members, by their names. */
function shape(value: unknown): unknown {
  if (value === null || typeof value !== "object") return value === null ? null : typeof value;
  if (Array.isArray(value)) return value.map(shape);
  const members = Object.entries(value).map(([name, member]) => [name, name === "unit" ? member : shape(member)] as const);
  return Object.fromEntries(members.sort(([a], [b]) => (a < b ? -1 : 1)));
}

/** A member that may be missing a value is `null` in one of the two. */
function alike(one: unknown, other: unknown): boolean {
  if (one === null || other === null || one === other) return true;
  if (typeof one !== "object" || typeof other !== "object") return false;
  const [a, b] = [Object.entries(one), new Map(Object.entries(other))];
  return a.length === b.size && a.every(([name, member]) => b.has(name) && alike(member, b.get(name)));
}

test("each message of the fake gateway is like that of a real one", async () => {
  const real = new Told(made.url);
  await until("the snapshot", async () => Promise.resolve(real.has("snapshot", "alive", "axis-0")));
  await until("a part", async () => Promise.resolve(real.has("cycle_done", "parts", "change")));
  await r6("panel", "--panel", made.panel, "alarm", "135");
  await until("an alarm", async () => Promise.resolve(real.has("alarm_began", "mode_changed")));
  // The arm comes to rest first.
  await until("the alarm is cleared", () => r6("panel", "--panel", made.panel, "clear").then(() => true, () => false));
  await until("its end", async () => Promise.resolve(real.has("alarm_ended")));
  real.close();

  const own = new Told(fake.url);
  await until("a snapshot", async () => Promise.resolve(own.has("snapshot")));
  await fake.pour(300);
  await until("all that it can tell", async () => Promise.resolve(own.has("alarm_ended", "parts", "alive", "change")));
  own.close();
  // All values, and what happens to the values.
  expect(own.kinds.size).toBeGreaterThan(25);
  for (const [kind, message] of own.kinds) {
    const [is, should] = [shape(message), shape(real.kinds.get(kind))];
    expect(real.kinds.has(kind), `a real gateway says ${kind}`).toBe(true);
    expect(alike(is, should), `${kind}: ${JSON.stringify(is)} and ${JSON.stringify(should)}`).toBe(true);
  }
  expect([...own.kinds.keys()].sort()).toEqual(expect.arrayContaining(["resume", "snapshot", "curMode", "counter-0", "cycle_done"]));
  const values = (told: Told): string[] => [...told.kinds.keys()].filter((kind) => !/^[a-z]+(_[a-z]+)*$/.test(kind)).sort();
  expect(values(own)).toEqual(values(real));
});

test("its answers are like those of a real one", async () => {
  const get = async (url: string, path: string): Promise<unknown> =>
    (await fetch(`${url}${path}`, { headers: { Authorization: `Bearer ${token}` } })).json();
  const span = `from=${new Date(Date.now() - 60_000).toISOString()}&to=${new Date().toISOString()}`;
  const history = (robot: string): string => `/v1/robots/${robot}/history?signal=axis-0&${span}&bucket=1000ms`;
  const [first] = fake.robots;
  for (const [path, of] of [
    ["/v1/session"],
    ["/v1/settings"],
    ["/v1/robots/press-01", `/v1/robots/${first?.name}`],
    [history("press-01"), history(first?.name ?? "")],
    ["/v1/alarms?active=true"],
  ] as const) {
    const bare = (answer: unknown): unknown => {
      const all = shape(answer) as Record<string, unknown>;
      // How many there are differs.
      return { ...all, signals: [], buckets: [], shifts: [], alarms: [] };
    };
    const [is, should] = [bare(await get(fake.url, of ?? path)), bare(await get(made.url, path))];
    expect(alike(is, should), `${path}: ${JSON.stringify(is)} and ${JSON.stringify(should)}`).toBe(true);
  }
});

test("a page shows the hall of the fake gateway, and its values change", async () => {
  browser = await startBrowser();
  const { page, faults } = await openSignedIn(browser);
  await page.goto(fake.url);
  await page.locator("[data-robot] .line").first().waitFor();
  expect(await page.locator("[data-robot]").count()).toBe(2);
  await page.goto(`${fake.url}/robots/${fake.robots[0]?.name}`);
  const value = page.locator("[data-value=axis-0]");
  await value.waitFor();
  const before = await value.textContent();
  fake.live();
  await until("the axis moves", async () => (await value.textContent()) !== before);
  fake.rest();
  expect(faults).toEqual([]);
});
