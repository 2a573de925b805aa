/** Times are those of the hall, whatever clock and tables the browser has. */
import type { Browser } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { type Cell, isAccessible, openPage, says, startBrowser, startCell, until } from "./support.ts";

let cell: Cell;
let browser: Browser;

beforeAll(async () => {
  [cell, browser] = await Promise.all([startCell(), startBrowser()]);
});

afterAll(async () => {
  await browser?.close();
  await cell?.up.kill("SIGKILL");
});

const HOUR = 3_600_000;

/** Turns the clock of a browser. It runs in the page, before its scripts. */
function turn(by: number): void {
  const Real = Date;
  class Turned extends Real {
    constructor(...of: unknown[]) {
      if (of.length === 0) super(Real.now() + by);
      else super(...(of as [number]));
    }
    static override now(): number {
      return Real.now() + by;
    }
  }
  globalThis.Date = Turned as DateConstructor;
}

test("a browser whose clock is two days behind asks for spans of the hall, and tells a stop with its time", async () => {
  const { page, faults } = await openPage(browser);
  await page.addInitScript(turn, -48 * HOUR);
  await page.goto(cell.link);
  await page.click("[data-robot=virtual]");
  await page.keyboard.press("F9");
  await says(page, "[data-told]", /stopped/i);
  // The day is named if it is not the one of now.
  expect(await page.textContent("[data-told]")).toMatch(/\b\d\d:\d\d:\d\d/);

  const asked: number[] = [];
  page.on("request", (request) => {
    const query = new URL(request.url()).searchParams;
    const to = query.get("to") ?? query.get("from");
    if (to !== null) asked.push(Date.parse(to));
  });
  for (const path of ["/production", "/alarms", "/history?robot=virtual&signal=axis-0&span=15m", "/robots/virtual"]) {
    asked.length = 0;
    await page.goto(`${cell.gateway}${path}`);
    await until(`${path} asks`, () => Promise.resolve(asked.length > 0));
    // No span ends two days ago, the first one neither.
    for (const to of asked) expect(Math.abs(to - Date.now()), path).toBeLessThan(36 * HOUR);
  }
  expect(faults).toEqual([]);
  await page.context().close();
});

test("the zone of the hall is asked for again when the gateway refused to tell it, and times are said to be in UTC", async () => {
  const { page, faults } = await openPage(browser);
  let refused = 0;
  await page.route("**/v1/settings", async (route) => {
    refused += 1;
    if (refused <= 2) await route.fulfill({ status: 429, json: { code: "too_many_requests", message: "too many requests" } });
    else await route.continue();
  });
  await page.goto(cell.link);
  await says(page, "[data-zone=unread]", "The time zone of the hall is not known yet. Times are in UTC.");
  await page.waitForSelector("[data-zone=unread]", { state: "detached" });
  expect([refused, faults]).toEqual([3, []]);
  await page.context().close();
});

test("where the browser does not know the zone of the hall, times are in UTC, and a stop is told", async () => {
  const { page, faults } = await openPage(browser);
  await page.route("**/v1/settings", async (route) => {
    const answer = await route.fetch();
    await route.fulfill({ response: answer, json: { ...((await answer.json()) as object), time_zone: "Etc/Unknown" } });
  });
  await page.goto(cell.link);
  await page.click("[data-robot=virtual]");
  await says(page, "[data-zone=unknown]", "This browser does not know the time zone of the hall, Etc/Unknown.");
  await page.keyboard.press("F9");
  await says(page, "[data-told]", new RegExp(`${new Date().toISOString().slice(11, 13)}:\\d\\d:\\d\\d`));
  await page.goto(`${cell.gateway}/production`);
  await page.waitForSelector("[data-zone=unknown]");
  await page.waitForSelector("main table, main [data-asked]");
  await isAccessible(page);
  expect(faults).toEqual([]);
  await page.context().close();
});

test("after the clock of the computer was set, the page says that ages are not known, until something is proved", async () => {
  const { page, faults } = await openPage(browser);
  await page.goto(cell.link);
  await page.waitForSelector("[data-robot=virtual]");
  await says(page, "[data-gateway]", /ms/);
  await page.evaluate((by) => {
    const said: string[] = [];
    const bar = document.querySelector("[data-gateway]")!;
    new MutationObserver(() => said.push(bar.textContent ?? "")).observe(bar, { childList: true, subtree: true, characterData: true });
    const now = Date.now.bind(Date);
    Date.now = () => now() + by;
    (window as unknown as { said: string[] }).said = said;
  }, 3 * HOUR);
  await says(page, "[data-gateway]", "not known how old the values are");
  await says(page, "[data-gateway]", /ms/);
  const said = await page.evaluate(() => (window as unknown as { said: string[] }).said);
  expect(said.filter((text) => text.includes("s old"))).toEqual([]);
  expect(faults).toEqual([]);
  await page.context().close();
});

test("a number is said to be read when it was asked for, however late the answer came", async () => {
  const { page, faults } = await openPage(browser);
  await page.route("**/query?address=counter-*", async (route) => {
    const answer = await route.fetch();
    await new Promise((next) => setTimeout(next, 3_000));
    await route.fulfill({ response: answer });
  });
  await page.goto(cell.link);
  await page.click("[data-robot=virtual]");
  const zone = await page.evaluate(async () => ((await (await fetch("/v1/settings")).json()) as { time_zone: string }).time_zone);
  const clock = (at: number): string => new Date(at).toLocaleTimeString("en-GB", { timeZone: zone });
  const asked = Date.now();
  await page.locator("section[aria-labelledby=numbers] button", { hasText: /read/i }).first().click();
  await says(page, "[data-number=counter]", "read");
  // The page knows the clock of the gateway to a second.
  const text = await page.textContent("[data-number=counter]");
  expect([-1, 0, 1, 2].map((more) => clock(asked + more * 1_000))).toContain(/read (\S+)/.exec(text ?? "")?.[1]);
  expect(faults).toEqual([]);
  await page.context().close();
});
