/**
 * What a hall of 500 robots costs the browser. `tools/web measure` does the same for longer, with all robots of the
 * hall at work and over a whole day, and prints a table. The limits here are wide enough for a busy machine.
 */
import { writeFileSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import type { Browser, Page } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { goWithMessages } from "./clock.ts";
import { FakeGateway, type Wanted } from "./fake.ts";
import { type Memory, memory, part, perFrame, traced } from "./measure.ts";
import { SOFTWARE_3D, openPage, says, startBrowser, until } from "./support.ts";

/** Whether it is measured at length. */
const LONG = process.env["R6_MEASURE"] === "1";
const TABLE = fileURLToPath(new URL("../../../target/web-measure.md", import.meta.url));
/** The goals: milliseconds, nodes and megabytes. */
const GOAL = { paint: 1_000, task: 50, frame: 8, nodes: 8_000, heap: 60 };
/** How long a hall is watched, in milliseconds, and how much of a day is told, in seconds. */
const WATCHED = LONG ? 20_000 : 2_000;
const DAY = LONG ? 86_400 : 1_800;
const ROBOTS = 500;

const rows: string[] = [];

function row(what: string, goal: string, seen: string): void {
  rows.push(`| ${what} | ${goal} | ${seen} |`);
}

afterAll(() => {
  if (!LONG) return;
  const table = ["| what | goal | seen |", "|---|---|---|", ...rows, ""].join("\n");
  writeFileSync(TABLE, table);
  console.log(`${table}\nalso in ${join("target", "web-measure.md")}`);
});

let browser: Browser;

beforeAll(async () => {
  browser = await startBrowser(LONG ? SOFTWARE_3D : undefined);
});

afterAll(async () => {
  await browser?.close();
});

async function begin(wanted: Wanted): Promise<FakeGateway> {
  const fake = new FakeGateway(wanted);
  await fake.begin();
  return fake;
}

const ms = (value: number): string => `${value.toFixed(1)} ms`;
const mb = (value: number): string => `${value.toFixed(1)} MB`;

/** Notes in the page when the first robot is there with its mode. */
function noteFirst(): void {
  const look = (): void => {
    if (document.querySelector("[data-robot] .line") === null) return;
    watching.disconnect();
    performance.mark("first-robot");
    // The frame with it was shown before the second one from now.
    requestAnimationFrame(() => requestAnimationFrame(() => performance.mark("first-shown")));
  };
  const watching = new MutationObserver(look);
  watching.observe(document, { childList: true, subtree: true });
}

async function mark(page: Page, name: string): Promise<number> {
  await until(name, async () => (await page.evaluate((of) => performance.getEntriesByName(of).length, name)) > 0);
  return page.evaluate((of) => performance.getEntriesByName(of)[0]?.startTime ?? 0, name);
}

test("500 robots ten times a second: no long task, few nodes, a small heap", async () => {
  const fake = await begin({ robots: ROBOTS, running: LONG ? ROBOTS : 100, lost: 3, alarmed: 5, alarmEvery: 20 });
  const { page, faults } = await openPage(browser);
  await page.addInitScript(noteFirst);
  fake.live();
  const first: number[] = [];
  const load = await traced(browser, page, async () => {
    for (let times = 0; times < (LONG ? 5 : 1); times += 1) {
      await page.goto("about:blank");
      await page.goto(fake.url);
      first.push(await mark(page, "first-robot"));
      await until("all robots", async () => (await page.locator("[data-robot]").count()) === ROBOTS);
    }
  });
  const watched = await traced(browser, page, () => page.waitForTimeout(WATCHED));
  // Scrolling through the hall makes tiles.
  const scrolled = await traced(browser, page, async () => {
    for (let down = 0; down < 12; down += 1) {
      await page.mouse.wheel(0, 700);
      await page.waitForTimeout(60);
    }
    await page.evaluate(() => scrollTo(0, document.body.scrollHeight));
    await page.locator("[data-robot] .line").last().waitFor();
  });
  const longest = ({ tasks }: { tasks: { busy: number }[] }): number => Math.max(...tasks.map(({ busy }) => busy));
  const { heap, nodes } = await memory(page);
  row("first tile of a robot, 500 robots, median of 5", "1 s", ms(part(first, 0.5)));
  row("longest task while the hall of 500 loads", `${GOAL.task} ms`, ms(longest(load)));
  row("longest task, hall of 500 running at 10 Hz", `${GOAL.task} ms`, ms(longest(watched)));
  row("longest task, while it is scrolled", `${GOAL.task} ms`, ms(longest(scrolled)));
  row("main thread a frame, hall of 500 running at 10 Hz, p95", `${GOAL.frame} ms`, ms(part(perFrame(watched), 0.95)));
  row("nodes of the document, hall of 500", String(GOAL.nodes), String(nodes));
  row("heap, hall of 500", mb(GOAL.heap), mb(heap));
  for (const one of [load, watched, scrolled]) expect(longest(one)).toBeLessThan(GOAL.task);
  expect(nodes).toBeLessThan(GOAL.nodes);
  expect(heap).toBeLessThan(GOAL.heap);
  expect(faults).toEqual([]);
  await page.context().close();
  await fake.end();
});

/** Opens a page whose clock goes with the messages, and tells it a part of a day. Returns what it takes from time to time. */
async function live(fake: FakeGateway, path: string, ready: string, seconds: number): Promise<{ seen: Memory[]; sent: number }> {
  const { page, faults } = await openPage(browser, { viewport: { width: 1280, height: 900 } });
  await page.addInitScript(goWithMessages);
  await page.goto(`${fake.url}${path}`);
  await page.waitForSelector(ready);
  const before = fake.sent;
  const seen: Memory[] = [];
  const PARTS = 12;
  for (let at = 0; at < PARTS; at += 1) {
    await fake.pour(Math.round(seconds / PARTS));
    // What was told last has come.
    const [robot] = fake.robots;
    if (path !== "/") await says(page, "[data-value=axis-0]", String(robot?.values.get("axis-0")));
    seen.push(await memory(page));
  }
  expect(faults).toEqual([]);
  await page.context().close();
  return { seen, sent: fake.sent - before };
}

/** How much the second half has more than the first: what is made once, and what is collected late, is in both. */
function growth(seen: Memory[], of: (one: Memory) => number): number {
  const half = seen.length / 2;
  // The first part fills buffers of fixed length.
  const first = seen.slice(2, half).map(of);
  const second = seen.slice(half).map(of);
  return part(second, 0.5) - part(first, 0.5);
}

test("a day's messages as fast as the page takes them leave nothing behind", async () => {
  for (const [name, path, ready] of [
    ["hall", "/", "[data-robot] .line"],
    ["robot", "/robots/lathe-401", "[data-value=axis-0]"],
  ] as const) {
    const fake = await begin({ robots: ROBOTS, running: 2, alarmEvery: 900 });
    const { seen, sent } = await live(fake, path, ready, DAY);
    await fake.end();
    const [heap, nodes] = [growth(seen, (one) => one.heap), growth(seen, (one) => one.nodes)];
    const at = (one: Memory | undefined): string => (one === undefined ? "-" : mb(one.heap));
    row(`heap after 2 h, 12 h and 24 h of messages, ${name} (${sent} messages)`, "flat", [seen[0], seen[5], seen[11]].map(at).join(", "));
    row(`nodes after 2 h, 12 h and 24 h, ${name}`, "flat", [seen[0], seen[5], seen[11]].map((one) => one?.nodes).join(", "));
    expect(heap, name).toBeLessThan(1);
    expect(nodes, name).toBeLessThan(200);
  }
});
