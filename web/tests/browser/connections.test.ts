import type { Browser } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { type Hall, looks, startHall } from "./gateway.ts";
import { Network, isAccessible, openPage, picture, says, startBrowser, until } from "./support.ts";

let hall: Hall;
let browser: Browser;
let admin = "";

beforeAll(async () => {
  [hall, browser] = await Promise.all([startHall(["press-1", "press-2"]), startBrowser()]);
  admin = await hall.token("admin");
});

afterAll(async () => {
  await browser?.close();
  await hall?.end();
});

test("connections: which is at fault; a robot is added, exchanged, accepted and removed", async () => {
  const { page, faults } = await openPage(browser);
  await page.goto(`${hall.url}/connections#${admin}`);
  await says(page, "[data-fault=some]", "Others answer the gateway, but not: saw.");
  await says(page, "[data-gateway-health]", /can be written[^]*2 of 3/);
  await says(page, "[data-row=press-1]", /up[^]*0 of \d+/);
  await page.getByRole("button", { name: "Details press-1" }).click();
  await says(page, ".below", "the file or the command line of the gateway");
  await looks(page, "connections");

  const { address } = ((await (await hall.ask(admin, "GET", "/v1/robots/press-2")).json()) as { address: string });
  const add = page.locator("form[aria-label='Add a robot']");
  await add.getByLabel("Robot", { exact: true }).fill("lab");
  await add.getByLabel("Address").fill(address);
  await add.getByRole("button").click();
  await page.waitForSelector("[data-problem=address_taken]");
  await add.getByLabel("Address").fill(hall.spare[0]);
  await add.getByLabel("Read besides the usual").fill("Addr-800");
  await add.getByRole("button").click();
  await page.waitForSelector("[data-row=lab] [data-link=up]");
  await page.getByRole("button", { name: "Details lab" }).click();
  await page.click("text=Change…");
  const dialog = page.locator("[role=dialog]");
  expect(await dialog.getByLabel("Read besides the usual").inputValue()).toBe("Addr-800");
  await isAccessible(page);
  await picture(page, "connections-change");
  await dialog.getByLabel("Read every").fill("250");
  await dialog.getByLabel("Address").fill(hall.spare[1]);
  await dialog.getByRole("button", { name: "Save" }).click();
  await says(page, "[data-row=lab]", "250 ms");

  // Another machine answers there: both are shown, and it is accepted only by a person who looked.
  await says(page, "[data-changed=lab]", /Expected[^]*GENERIC-SCARA[^]*Answers now[^]*BRTIRUS0707A/);
  await isAccessible(page);
  await picture(page, "connections-changed", true);
  await page.click("text=Accept the robot that answers…");
  await says(page, "[role=dialog]", /Is this lab from now on\?[^]*BRTIRUS0707A/);
  await dialog.getByRole("button", { name: "Accept it" }).click();
  await page.waitForSelector("[data-changed=lab]", { state: "detached" });
  await page.click("text=Remove…");
  await dialog.getByRole("button", { name: "Remove lab" }).click();
  await page.waitForSelector("[data-row=lab]", { state: "detached" });
  expect(faults).toEqual([]);
  await page.context().close();
});

test("a lost gateway is the fault, and another build of the page is offered when it comes back", async () => {
  const { hostname, port } = new URL(hall.url);
  const network = new Network({ host: hostname, port: Number(port) });
  const url = await network.open();
  const { page, faults } = await openPage(browser);
  await page.goto(`${url}/connections#${admin}`);
  await says(page, "[data-fault=some]", "saw");
  await network.cut();
  await says(page, "[data-fault=gateway]", "This page does not hear the gateway.");
  await says(page, "[data-row=press-1] [data-link]", "not known");
  await isAccessible(page);
  await picture(page, "connections-lost");
  // The same build is back: nothing is offered. Then another one is.
  let looked = page.waitForResponse((response) => new URL(response.url()).pathname === "/");
  await network.open();
  await looked;
  await says(page, "[data-fault=some]", "saw");
  await says(page, "[data-row=press-1]", /up\s*no change recorded/);
  await until("what is shown is of now", async () => (await page.locator("[data-problem], [data-as-of]").count()) === 0);
  expect(await page.locator("[data-new-build]").count()).toBe(0);
  await page.route(`${url}/`, async (route) => {
    const response = await route.fetch();
    await route.fulfill({ response, body: (await response.text()).replace(/index-[\w-]+\.js/, "index-another.js") });
  });
  await network.cut();
  await says(page, "[data-fault=gateway]", "This page does not hear the gateway.");
  await network.open();
  await says(page, "[data-new-build]", "The gateway has another version of this page.");
  await isAccessible(page);
  await picture(page, "new-build");
  expect(faults).toEqual([]);
  await network.cut();
  await page.context().close();
});
