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
