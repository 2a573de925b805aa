import type { Browser } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { type Cell, Network, isAccessible, openPage, picture, r6, says, startBrowser, startCell } from "./support.ts";

let cell: Cell;
let browser: Browser;

beforeAll(async () => {
  [cell, browser] = await Promise.all([startCell(), startBrowser()]);
});

afterAll(async () => {
  await browser?.close();
  await cell?.up.kill("SIGKILL");
});

const STOP = "[data-stop=virtual]";
const TOLD = "[data-told]";
const GONE = { state: "detached" } as const;

test("a lost gateway is said at once, controls go off, and the page comes back by itself", async () => {
  const { hostname, port, hash } = new URL(cell.link);
  const network = new Network({ host: hostname, port: Number(port) });
  const url = await network.open();
  const { page, faults } = await openPage(browser);
  await page.goto(`${url}/${hash}`);
  await page.click("[data-robot=virtual]");
  await page.click("text=Take control");
  await page.waitForSelector("[data-lease=mine]");
  await page.locator("[aria-labelledby=charts]").scrollIntoViewIfNeeded();
  await page.waitForSelector("[data-chart][data-reading=false]");
  expect(page.workers().length, "the policy of the page allows the worker that reads the stream").toBe(1);

  await network.cut();
  await says(page, "[role=alert]", "No connection to the gateway");
  expect(await page.isDisabled("[data-control=pause]")).toBe(true);
  await says(page, "[data-lease]", "Your control has ended.");
  expect(await page.getAttribute("[data-doing]", "class")).toContain("hatched");
  await says(page, "[data-doing]", "Last known:");
  // From 5 s on, no old value is shown.
  await says(page, "[data-value=axis-0]", /^-$/);
  await isAccessible(page);
  await picture(page, "lost");
  let failed = 0;
  page.on("requestfailed", (request) => (failed += request.url().endsWith("/stop") ? 1 : 0));
  await page.click(STOP);
  await says(page, TOLD, "virtual: NOT SENT. Use the emergency stop at the robot.");
  // Questions of a chart have no answer now. They are asked again when the gateway is back.
  await page.click("[data-span='8h']");
  await page.waitForSelector("[data-problem=no_answer]");

  // The stop is sent twice more: with the network, it would reach the arm now.
  await expect.poll(() => failed, { timeout: 20_000 }).toBe(3);
  await network.open();
  await page.waitForSelector("[role=alert]", GONE);
  await says(page, "[data-value=axis-0]", /^0\.000$/);
  expect(await page.getAttribute("[data-doing]", "class")).not.toContain("hatched");

  // A gateway that hangs: the connections stay open, and nothing comes.
  network.isSilent = true;
  await page.click(STOP);
  await says(page, TOLD, "virtual: NOT CONFIRMED. Use the emergency stop at the robot.");
  await says(page, "[role=alert]", "and the connection did not end: the gateway or the network hangs.");
  expect(await page.textContent("[data-gateway]")).toContain("gateway silent");
  network.isSilent = false;
  await page.waitForSelector("[role=alert]", GONE);
  await r6("-r", cell.robot, "move", "axes", "5", "0", "0", "0", "30", "0", "--speed", "50", "--wait");
  await says(page, "[data-value=axis-0]", /^5\.000$/);
  expect(faults).toEqual([]);
  await network.cut();
  await page.context().close();
});

test("values that a slow network brings late are not those of now, and no arm is said to stand", async () => {
  const { hostname, port, hash } = new URL(cell.link);
  const network = new Network({ host: hostname, port: Number(port) });
  const url = await network.open();
  const { page, faults } = await openPage(browser);
  await page.goto(`${url}/${hash}`);
  await page.click("[data-robot=virtual]");
  await says(page, "[data-value=axis-0]", /^\d/);
  await says(page, "[data-gateway]", /gateway \d+ ms/);
  await says(page, "[data-doing]", /^(?!.*Last known:)/s);

  network.delay = 8_000;
  await says(page, "[data-gateway]", "gateway slow: values are up to");
  // Messages come from now on, each of them 8 s late.
  const end = Date.now() + 12_000;
  while (Date.now() < end) {
    const [doing, gateway] = [await page.textContent("[data-doing]"), await page.textContent("[data-gateway]")];
    expect(gateway).toMatch(/gateway (slow|silent|lost)|Connecting/);
    expect(doing).toContain("Last known:");
    expect(doing).not.toMatch(/he arm stands(?! is not known)/);
    expect(await page.getAttribute("[data-doing]", "class")).toContain("hatched");
    expect(await page.isDisabled("[data-control=start]")).toBe(true);
    await new Promise((next) => setTimeout(next, 200));
  }
  await isAccessible(page);
  await picture(page, "slow");

  network.delay = 0;
  await says(page, "[data-gateway]", /gateway \d+ ms/);
  await says(page, "[data-doing]", /^(?!.*Last known:)/s);
  expect(faults).toEqual([]);
  await network.cut();
  await page.context().close();
});

test("a killed gateway is said, a stop is not sent, and the next start asks to sign in", async () => {
  const { page, faults } = await openPage(browser);
  await page.goto(cell.link);
  await page.click("[data-robot=virtual]");
  await page.waitForSelector("[data-lease=free]");
  await cell.up.kill("SIGKILL");
  await says(page, "[role=alert]", "No connection to the gateway");
  await page.keyboard.press("F9");
  await says(page, TOLD, "virtual: NOT SENT.");

  // It stays until somebody has read it, also on another page. Without the gateway, each robot may move.
  await page.click("text=‹ Hall");
  await says(page, "[data-outcome=virtual]", "virtual: NOT SENT. Use the emergency stop at the robot.");
  await page.waitForSelector("[data-needs=unknown]");
  await isAccessible(page);
  await page.click("text=STOP…");
  await page.waitForSelector("[role=group] [data-stop=virtual]");
  await says(page, "[role=group]", "Which robots move is not known.");
  expect(await page.locator("[data-outcome]").count(), "its button says it").toBe(0);
  await isAccessible(page);
  await page.click("text=Close");
  await page.getByRole("button", { name: "Seen virtual" }).click();
  await page.waitForSelector("[data-outcome]", GONE);
  expect(faults).toEqual([]);
  await page.context().close();
});

test("an order is carried out once, also if its connection breaks before the answer", async () => {
  const own = await startCell();
  const { hostname, port, hash } = new URL(own.link);
  const network = new Network({ host: hostname, port: Number(port) });
  const { page, faults } = await openPage(browser);
  try {
    await page.goto(`${await network.open()}/robots/virtual${hash}`);
    await page.click("text=Take control");
    await page.waitForSelector("[data-lease=mine]");
    // Answers to questions leave connections open, over which the order goes. The browser sends it again by itself.
    await page.waitForResponse((answer) => answer.url().endsWith("/healthz"));
    network.breaks = "POST /v1/robots/virtual/commands";
    let requests = 0;
    page.on("request", (request) => (requests += request.url().endsWith("/commands") ? 1 : 0));
    await page.click("[data-control=pause]");
    await says(page, "[data-told-command]", "Pause: accepted");
    expect([network.breaks, requests]).toEqual([null, 1]);

    network.breaks = "POST /v1/robots/virtual/clear-stopped";
    await page.click("[data-control=clear_stop]");
    // The second request finds no stop that it may clear, or the first one's answer.
    await says(page, "[data-told-command]", /Clear stop/);
    await page.waitForSelector("[data-control=clear_stop]:disabled");
    expect(faults.filter((fault) => !fault.includes("409"))).toEqual([]);
  } finally {
    await network.cut();
    await page.context().close();
    await own.up.kill();
  }
});
