/** What the page says of refusals, and of names that others gave. */
import type { Browser } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { type Hall, startHall } from "./gateway.ts";
import { fits, isAccessible, openPage, picture, says, startBrowser } from "./support.ts";

let hall: Hall;
let browser: Browser;
let engineer = "";

beforeAll(async () => {
  [hall, browser] = await Promise.all([startHall(["press-1"]), startBrowser()]);
  engineer = await hall.token("engineer");
});

afterAll(async () => {
  await browser?.close();
  await hall?.end();
});

test("a Chinese page says a refusal in Chinese, with what the gateway said in English under it", async () => {
  const { page, faults } = await openPage(browser, { locale: "zh-CN", viewport: { width: 390, height: 844 } });
  await page.route("**/v1/robots/press-1/commands", (route) =>
    route.fulfill({ status: 409, json: { code: "leased", message: "op-2 holds the lease" } }),
  );
  await page.goto(`${hall.url}/robots/press-1#${engineer}`);
  await page.click("[data-control=pause]");
  await says(page, "[data-told-command=control]", "暂停：被拒绝。他人正在控制，或其程序正在停止。请等待其交还控制权");
  expect(await page.textContent("[data-told-command=control]")).not.toContain("op-2");
  const original = page.locator("[data-original=leased]");
  await original.locator("summary").click();
  expect(await original.locator("[lang=en]").innerText()).toBe("op-2 holds the lease");
  await fits(page);
  await isAccessible(page);
  await picture(page, "refusal-390-zh", true);
  expect(faults).toEqual([]);
  await page.context().close();
});
