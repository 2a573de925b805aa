import type { Browser } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { Running, fits, folder, hasThisPage, isAccessible, openPage, picture, r6, says, startBrowser, until } from "./support.ts";

const NAMES = ["pack-01", "pack-02", "press-01", "press-02", "press-03", "press-04", "saw-01", "saw-02"];
const PASSWORD = "correct horse battery";
const data = folder();
let browser: Browser;
let robots: Running;
let gateway: Running;
let panel = "";
let url = "";

beforeAll(async () => {
  const listen = NAMES.flatMap(() => ["--listen", "127.0.0.1:0"]);
  robots = new Running("sim", ...listen, "--panel", "127.0.0.1:0");
  panel = await robots.said(/panel on http:\/\/(\S+)/);
  const addresses = [...(await robots.all(/listening on (\S+)/g, NAMES.length))];
  const named = NAMES.flatMap((name, at) => ["--robot", `${name}=${addresses[at]}`]);
  // Nothing listens there.
  named.push("--robot", "saw-03=127.0.0.1:1");
  gateway = new Running("gateway", "--listen", "127.0.0.1:0", "--data", data.path, ...named);
  const secret = await gateway.said(/\/setup#(\S+)/);
  url = await gateway.said(/gateway on (http:\/\/[^\s,]+)/);
  await hasThisPage(url);
  const body = JSON.stringify({ secret, name: "anna", password: PASSWORD });
  const headers = { "Content-Type": "application/json" };
  const made = await fetch(`${url}/v1/setup`, { method: "POST", headers, body });
  expect(made.status).toBe(204);
  browser = await startBrowser();
});

afterAll(async () => {
  await browser?.close();
  await gateway?.kill();
  await robots?.kill();
  data.remove();
});

test("a user signs in with a password; a wrong one is said", async () => {
  const { page, faults } = await openPage(browser, { viewport: { width: 390, height: 844 } });
  await page.goto(`${url}/#not-a-token`);
  await says(page, "[role=alert]", "no valid token");
  await isAccessible(page);
  const form = page.locator("form").first();
  await form.getByLabel("Name").fill("anna");
  await form.getByLabel("Password").fill("a wrong password");
  await form.getByRole("button").click();
  await says(page, "[role=alert]", "The name or the password is wrong");
  await form.getByLabel("Password").fill(PASSWORD);
  await form.getByRole("button").click();
  await page.waitForSelector("[data-robot=press-04]");
  await fits(page);
  await page.click("summary");
  await page.click("text=Sign out");
  await page.waitForSelector("form");
  expect((await page.context().cookies()).filter(({ name }) => name.startsWith("r6_session"))).toEqual([]);
  expect(faults).toEqual([]);
  await page.context().close();
});

test("the hall shows who needs a person, finds robots, and stops them", async () => {
  const token = (await r6("gateway", "token", "--data", data.path, "--role", "operator")).trim();
  await r6("panel", "--panel", panel, "--controller", "6", "estop");
  const { page, faults } = await openPage(browser);
  await page.goto(`${url}/#${token}`);
  await says(page, "ol", /press-04\s+alarm 7: emergency stop/);
  await says(page, "ol", /saw-03\s+link lost/);
  await says(page, "[data-robot=saw-03]", /no link/);
  const first = await page.textContent("ol > li");
  expect(first).toContain("press-04");
  // The map has its own order, which the alarm does not change.
  const order = await page.locator("[data-robot]").evaluateAll((tiles) => tiles.map((tile) => tile.getAttribute("data-robot")));
  expect(order).toEqual([...NAMES, "saw-03"]);
  await isAccessible(page);
  for (const theme of ["light", "dark"] as const) {
    await page.emulateMedia({ colorScheme: theme });
    await until(theme, async () => (await page.getAttribute("html", "data-theme")) === theme);
    await isAccessible(page);
    for (const width of [1920, 768, 390]) {
      await page.setViewportSize({ width, height: width === 390 ? 844 : width === 768 ? 1024 : 720 });
      await fits(page);
      await picture(page, width === 1920 ? `dashboard-${theme}` : `hall-${width}-${theme}`);
    }
    await page.setViewportSize({ width: 1920, height: 1080 });
  }
  await page.fill("[type=search]", "PRESS 03");
  await until("one robot is left", async () => (await page.locator("[data-robot]").count()) === 1);
  expect(new URL(page.url()).search).toBe("?q=PRESS+03");
  await page.fill("[type=search]", "");

  // Stop lists those that may move; each has its own button, and all are held.
  await page.click("text=STOP…");
  await page.waitForSelector("[data-stop=press-01]");
  await isAccessible(page);
  await picture(page, "hall-stop");
  await page.click("[data-stop=press-01]");
  await says(page, "[role=group] li:has([data-stop=press-01]) [data-told]", /^\s*stopped, seen/);
  await says(page, "[data-robot=press-01]", "stop holds");
  // Those that are not seen to move can be stopped all the same.
  await page.waitForSelector(`text=Hold to stop every robot (${NAMES.length + 1})`);
  const hold = page.locator("text=/Hold to stop all/");
  await hold.click();
  expect(await page.textContent("[role=group] li:has([data-stop=press-02]) [data-told]")).not.toContain("stop");
  await hold.hover();
  await page.mouse.down();
  await says(page, "[role=group] li:has([data-stop=press-02]) [data-told]", /^\s*stopped, seen/);
  await page.mouse.up();
  expect(faults).toEqual([]);
  await page.context().close();
});

test("an address of no page says so, with the stop and the way to the hall", async () => {
  const token = (await r6("gateway", "token", "--data", data.path, "--role", "viewer")).trim();
  const { page } = await openPage(browser);
  await page.goto(`${url}/#${token}`);
  await page.waitForSelector("[data-robot]");
  const answer = await page.goto(`${url}/robots/press-01/no/such/page`);
  expect(answer?.status()).toBe(404);
  await says(page, "h1", "There is no such page.");
  await page.getByRole("button", { name: /^STOP/ }).waitFor();
  await isAccessible(page);
  await page.getByRole("link", { name: "Back to the hall" }).click();
  await page.waitForSelector("[data-robot]");
  await page.context().close();
});

test("a viewer sees everything, and each control says why it is off", async () => {
  const token = (await r6("gateway", "token", "--data", data.path, "--role", "viewer")).trim();
  const { page, faults } = await openPage(browser, { viewport: { width: 768, height: 1024 }, colorScheme: "dark" });
  await page.goto(`${url}/robots/press-02#${token}`);
  await page.waitForSelector("[data-doing]");
  expect(await page.isDisabled("text=Take control")).toBe(true);
  await says(page, "[data-lease]", "this needs the role operator");
  await page.click("[data-tab=io]");
  await page.waitForSelector('[data-point="input 1"]');
  await fits(page);
  await isAccessible(page);
  await picture(page, "robot-768-dark", true);
  await page.click("[data-stop=press-02]");
  await says(page, "[data-told]", "press-02: NOT SENT. Use the emergency stop at the robot. You have no right to stop it.");

  // Another link does not replace the session unasked.
  const other = (await r6("gateway", "token", "--data", data.path, "--role", "operator")).trim();
  await page.goto("about:blank");
  await page.goto(`${url}/#${other}`);
  await says(page, "main", /A session is open in this browser: token \d+ · viewer\.[^]*signs in somebody else: token \d+ · operator\./);
  await isAccessible(page);
  await page.click("text=/^Go on as token/");
  await says(page, "summary", "viewer");
  await page.goto(`${url}/robots/no-such-robot`);
  await says(page, "main", "There is no robot “no-such-robot”");
  expect(faults).toEqual([]);
  await page.context().close();
});
