/** A gateway that does nothing any more: its connections stay open, and of the robots nothing is known. */
import type { Browser } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { type Hall, startHall } from "./gateway.ts";
import { isAccessible, openPage, picture, says, startBrowser, until } from "./support.ts";

let hall: Hall;
let browser: Browser;

beforeAll(async () => {
  [hall, browser] = await Promise.all([startHall(["press-1"]), startBrowser()]);
});

afterAll(async () => {
  await browser?.close();
  await hall?.end();
});

test("a frozen gateway is not told as a lost link of a robot", async () => {
  const { page, faults } = await openPage(browser);
  await page.goto(`${hall.url}/#${await hall.token("engineer")}`);
  await says(page, "[data-robot=press-1]", /running|at rest/);
  // `saw` has nothing at its address.
  await says(page, "[data-robot=saw]", "no link");
  const robot = await page.context().newPage();
  await robot.goto(`${hall.url}/robots/saw`);
  await says(robot, "[data-doing]", "The gateway has no link to this robot.");

  hall.freeze();
  const tile = async (name: string): Promise<string> => (await page.textContent(`[data-robot=${name}]`)) ?? "";
  await until("the tiles are old", async () => /\d s old/.test(await tile("press-1")) && /\d s old/.test(await tile("saw")));
  await page.bringToFront();
  await says(page, "[role=alert]", "the connection did not end: the gateway or the network hangs");
  await says(page, "[data-gateway]", "gateway silent");
  expect(await tile("press-1")).not.toContain("link");
  expect(await tile("saw"), "what was known then").toMatch(/had no link, \d+ s old$/);
  await says(page, "[data-needs=unknown]", /The gateway is not heard\.[^]*Last known:/);
  expect(await page.getAttribute("[aria-labelledby=needs] li", "class")).toContain("hatched");
  // How long it waits is as of when the gateway was heard.
  const waits = await page.textContent("[aria-labelledby=needs] ol");
  await page.waitForTimeout(2_100);
  expect(await page.textContent("[aria-labelledby=needs] ol")).toBe(waits);
  await says(robot, "[data-doing]", /Last known:\s+The gateway has no link to this robot\./);
  const reasons = await robot.locator("[aria-labelledby=control] li").first().textContent();
  expect(reasons).toContain("the gateway is not heard");
  expect(reasons).not.toContain("no link");
  await isAccessible(page);
  await picture(page, "frozen");

  hall.thaw();
  await page.waitForSelector("[role=alert]", { state: "detached" });
  await says(page, "[data-robot=saw]", /no link( \d|$|\s*$)/);
  await until("the link is there", async () => !/link|old/.test(await tile("press-1")));
  expect(faults).toEqual([]);
  await page.context().close();
});
