/** Tables on a phone: what matters stands there without scrolling sideways. */
import type { Browser } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { REST, RUNS } from "../../src/stop/finger.ts";
import { type Hall, startHall } from "./gateway.ts";
import { fits, isAccessible, openPage, picture, says, sideways, startBrowser } from "./support.ts";

let hall: Hall;
let browser: Browser;
let admin = "";

beforeAll(async () => {
  [hall, browser] = await Promise.all([startHall(["press-01-of-line-a", "press-2"]), startBrowser()]);
  admin = await hall.token("admin", "--name", "the screen beside the door of hall 2");
  expect((await hall.ask(admin, "POST", "/v1/robots/press-2/stop")).status).toBe(200);
  const program = `[[instruction]]\ndo = "axis-move"\nto = [30, 0, 0, 0, 0, 0]\nspeed = 40\n`;
  const headers = { Authorization: `Bearer ${admin}`, "Content-Type": "application/json", "If-None-Match": "*" };
  const stored = await fetch(`${hall.url}/v1/programs/sweep`, { method: "PUT", headers, body: JSON.stringify({ program }) });
  expect(stored.status).toBe(201);
});

afterAll(async () => {
  await browser?.close();
  await hall?.end();
});

test("on a phone the tables of the hall are not scrolled sideways", async () => {
  const { page, faults } = await openPage(browser, { viewport: { width: 390, height: 844 }, hasTouch: true });
  await page.goto(`${hall.url}/#${admin}`);
  await page.waitForSelector("[data-robot=press-2]");
  for (const [path, there] of [
    ["production", "[data-each='press-2 1']"],
    ["audit", "[data-what=stop]"],
    ["connections", "[data-link=up]"],
    ["users", "main [role=table], [data-empty]"],
    ["tokens", "[role=row]"],
    ["alarms", "main h2"],
    ["robots/press-2", "[data-doing]"],
    ["robots/press-2/teach", "[data-program=sweep]"],
  ] as const) {
    await page.goto(`${hall.url}/${path}`);
    await page.waitForSelector(there, { state: "attached" });
    expect(await sideways(page), path).toEqual([]);
    await fits(page);
    await isAccessible(page);
    await picture(page, `narrow-${path.replace(/\W/g, "-")}`, true);
  }
  // The name of a column stands before each value.
  const title = await page
    .locator("[data-program=sweep] td")
    .first()
    .evaluate((cell) => getComputedStyle(cell, "::before").content);
  expect(title).toContain("Version");
  expect(faults).toEqual([]);
  await page.context().close();
});

test("scrolling the list of stops sends none; a tap, a press and a jab at a button do", async () => {
  const { page, faults } = await openPage(browser, { viewport: { width: 390, height: 420 }, hasTouch: true });
  await page.goto(`${hall.url}/#${admin}`);
  await page.waitForSelector("[data-robot=press-2]");
  const stopped: string[] = [];
  page.on("request", (request) => {
    if (request.url().endsWith("/stop")) stopped.push(new URL(request.url()).pathname);
  });
  await page.tap("text=STOP…");
  const button = page.locator("[role=group] [data-stop=saw]");
  await button.waitFor();
  const finger = await page.context().newCDPSession(page);
  const touch = (type: "touchStart" | "touchMove" | "touchEnd", at?: { x: number; y: number }) =>
    finger.send("Input.dispatchTouchEvent", { type, touchPoints: at === undefined ? [] : [at] });
  const middle = async (): Promise<{ x: number; y: number }> => {
    const { x, y, width, height } = (await button.boundingBox())!;
    return { x: x + width / 2, y: y + height / 2 };
  };
  const reach = async (): Promise<void> => {
    await button.scrollIntoViewIfNeeded();
    // A touch of a list that still runs holds the list.
    await page.waitForTimeout(2 * RUNS);
  };
  /** How high each robot of the list is: what is told of a stop moves no button. */
  const heights = (): Promise<number[]> => page.locator("[role=group] li").evaluateAll((all) => all.map((one) => one.clientHeight));
  const list = page.locator("[role=group]:has([data-stop=saw])");
  expect(await list.evaluate((one) => Math.round((one.clientHeight / innerHeight) * 10)), "it does not grow under a finger").toBe(7);
  const before = await heights();
  const from = await middle();
  await touch("touchStart", from);
  for (const up of [8, 20, 40, 60]) await touch("touchMove", { x: from.x, y: from.y - up });
  await page.waitForFunction(() => [...document.querySelectorAll("[role=group]")].some((one) => one.scrollTop > 0));
  await touch("touchEnd");
  // Nothing is to come: for so long a press could still follow.
  await page.waitForTimeout(2 * REST);
  expect(stopped).toEqual([]);
  await reach();
  await touch("touchStart", await middle());
  await touch("touchEnd");
  // It is sent again by itself, since nothing answers: three times in all.
  await expect.poll(() => stopped.length, { timeout: 20_000 }).toBe(3);
  // A finger that is not lifted.
  await page.waitForSelector("[role=group] [data-told=not_confirmed], [role=group] [data-told=not_sent]");
  expect(await heights()).toEqual(before);
  const told = page.locator("[role=group] [data-told^=not_]");
  expect(await told.textContent()).toMatch(/^\s*NOT \w+\. Use the emergency stop at the robot\. /);
  expect(await told.evaluate((one) => one.scrollHeight <= one.clientHeight), "all of it is seen").toBe(true);
  await reach();
  await touch("touchStart", await middle());
  await expect.poll(() => stopped.length, { timeout: 20_000 }).toBeGreaterThan(3);
  await touch("touchEnd");
  // A jab that slides a little, where nothing is to be scrolled sideways.
  await expect.poll(() => stopped.length, { timeout: 20_000 }).toBe(6);
  const at = await middle();
  await touch("touchStart", at);
  await touch("touchMove", { x: at.x + 20, y: at.y });
  await touch("touchEnd");
  await expect.poll(() => stopped.length, { timeout: 20_000 }).toBeGreaterThan(6);
  await expect.poll(() => stopped.length, { timeout: 20_000 }).toBe(9);
  // The list is closed under a finger that has neither rested nor been lifted.
  await reach();
  await touch("touchStart", await middle());
  await page.keyboard.press("Escape");
  await expect.poll(() => stopped.length, { timeout: 20_000 }).toBeGreaterThan(9);
  await touch("touchEnd");
  expect(new Set(stopped)).toEqual(new Set(["/v1/robots/saw/stop"]));
  // What did not fit in the list is read once it is closed.
  await page.waitForSelector("[data-outcome=saw]");
  expect(faults).toEqual([]);
  await page.context().close();
});

test("what is wider than its place says so, and is scrolled with keys", async () => {
  const { page, faults } = await openPage(browser, { viewport: { width: 390, height: 844 } });
  await page.goto(`${hall.url}/production?one=press-2#${admin}`);
  const part = page.getByRole("group", { name: "How long its cycles took" });
  await says(page, "[data-scrolls]", "There is more at the side");
  expect(await sideways(page)).toEqual(["How long its cycles took"]);
  await part.focus();
  await page.keyboard.press("ArrowRight");
  await page.waitForFunction(() => [...document.querySelectorAll("[role=group]")].some((one) => one.scrollLeft > 0));
  await isAccessible(page);
  // With room for all of it nothing is said.
  await page.setViewportSize({ width: 1400, height: 900 });
  await page.waitForSelector("[data-scrolls]", { state: "detached" });
  expect(faults).toEqual([]);
  await page.context().close();
});
