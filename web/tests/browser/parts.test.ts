import type { Browser } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { type Cell, Network, isAccessible, openPage, says, startBrowser, startCell, until } from "./support.ts";

let cell: Cell;
let browser: Browser;

beforeAll(async () => {
  [cell, browser] = await Promise.all([startCell(), startBrowser()]);
});

afterAll(async () => {
  await browser?.close();
  await cell?.up.kill();
});

test("a part that could not be loaded says whether the gateway is away or has another build, and is loaded again", async () => {
  const { hostname, port, hash } = new URL(cell.link);
  const network = new Network({ host: hostname, port: Number(port) });
  const url = await network.open();
  const { page } = await openPage(browser);
  await page.goto(`${url}/${hash}`);
  await page.waitForSelector("[data-robot=virtual]");

  // The gateway is away while a page is opened whose part was not loaded yet.
  await network.cut();
  await page.click("a[href='/alarms']");
  await says(page, "[data-part-failed=away]", "The gateway does not answer.");
  expect(await page.locator("[data-part-failed] button").count(), "nothing loads the page while the gateway is away").toBe(1);
  await isAccessible(page);
  await network.open();
  await says(page, "[data-part-failed=same]", "The gateway answers now.");
  const stop = page.locator("button", { hasText: "STOP" });
  expect(await stop.count(), "Stop is there all the time").toBeGreaterThan(0);
  await page.click("[data-part-failed] button:text('Try again')");
  // A browser may keep that a part could not be loaded. Then the page has to be loaded again.
  await until("the part is there", async () => {
    if ((await page.locator("#now").count()) > 0) return true;
    const again = page.locator("[data-part-failed=same] button:text('Load the page again')");
    await again.click({ timeout: 1_000 }).catch(() => undefined);
    return false;
  });

  // Another build: its parts have other names, so those of this page are not there any more.
  await page.route("**/assets/ProductionPage*.js", (route) => route.fulfill({ status: 404, body: "" }));
  await page.route(`${url}/`, async (route) => {
    const response = await route.fetch();
    await route.fulfill({ response, body: (await response.text()).replace(/\/assets\/index-[^"]+\.js/, "/assets/index-other.js") });
  });
  await page.click("a[href='/production']");
  await says(page, "[data-part-failed=other]", "The gateway has another version of this page");
  await page.unrouteAll();
  await page.click("[data-part-failed] button:text('Load the page again')");
  await page.waitForSelector("[data-part-failed]", { state: "detached" });
  await says(page, "h1", "Production");
  await network.cut();
  await page.context().close();
});
