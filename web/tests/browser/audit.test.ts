import type { Browser } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { type Hall, looks, startHall } from "./gateway.ts";
import { fits, isAccessible, openPage, picture, says, startBrowser, until } from "./support.ts";

let hall: Hall;
let browser: Browser;
let engineer = "";
let viewer = "";

beforeAll(async () => {
  [hall, browser] = await Promise.all([startHall(["press-1", "press-4"]), startBrowser()]);
  engineer = await hall.token("engineer");
  const screen = await hall.token("operator", "--name", "screen");
  viewer = await hall.token("viewer");
  const stopped = await hall.ask(screen, "POST", "/v1/robots/press-4/stop");
  expect(stopped.status).toBe(200);
  expect((await hall.ask(screen, "POST", "/v1/robots/press-1/stop")).status).toBe(200);
  expect((await hall.ask(viewer, "POST", "/v1/robots/press-4/stop")).status).toBe(403);
});

afterAll(async () => {
  await browser?.close();
  await hall?.end();
});

test("one click shows who stopped robot 4: who, from where, when, and whether the arm was seen to stand", async () => {
  const { page, faults } = await openPage(browser);
  await page.goto(`${hall.url}/robots/press-4#${engineer}`);
  await page.click("[data-stopped-by]");
  await says(page, "[role=table]", "It was seen that the arm stands.");
  expect(new URL(page.url()).search).toBe("?robot=press-4&kind=stop");
  const rows = page.locator("tbody > tr");
  expect(await rows.count()).toBe(2);
  const row = (await rows.first().textContent()) ?? "";
  expect(row).toMatch(/\d\d:\d\d:\d\d/);
  expect(row).toContain("token 2 (screen)");
  expect(row).toContain("127.0.0.1");
  expect(row).toContain("press-4");
  expect(await page.textContent("[role=table]")).not.toContain("press-1");
  await page.getByRole("button", { name: /^Details, Entry/ }).first().click();
  await says(page, ".below", /confirmed\s*true/);
  await looks(page, "audit");

  // Filters are in the address, and a link has them too.
  await page.getByLabel("Kind").selectOption("refused");
  await page.getByLabel("Robot", { exact: true }).selectOption("");
  await says(page, "[role=table]", "stop: refused (not_allowed).");
  expect(new URL(page.url()).search).toBe("?kind=refused");
  await page.getByLabel("Person or token").fill("no such person");
  await says(page, "[data-empty]", "No entry matches.");
  await isAccessible(page);
  await page.click("text=Clear the filters");
  await says(page, "[role=table]", "The gateway started.");
  // An hour before the first entry, in the time of the hall.
  await page.getByLabel("To", { exact: true }).fill("2020-01-01T06:00");
  await says(page, "[data-empty]", "No entry matches.");
  expect(new URL(page.url()).search).toBe("?to=2020-01-01T06%3A00");
  expect(faults).toEqual([]);
  await page.context().close();
});

test("the end of the log is signed, and a head that was kept is compared", async () => {
  const { page, faults } = await openPage(browser);
  await page.goto(`${hall.url}/audit#${engineer}`);
  await page.click("text=Sign the end of the log now");
  await says(page, "[data-head]", "r6-gateway/audit/");
  const [file] = await Promise.all([page.waitForEvent("download"), page.click("text=Save as a file")]);
  const head = (await (await hall.ask(engineer, "GET", "/v1/audit/head")).json()) as { number: number; hash: string };
  expect(file.suggestedFilename()).toBe(`audit-head-${head.number}.json`);
  const compare = async (text: string, result: string): Promise<void> => {
    await page.fill("textarea", text);
    await page.click("text=/^Compare$/");
    await page.waitForSelector(`[data-compared=${result}]`);
  };
  await compare(JSON.stringify(head), "same");
  await compare(JSON.stringify({ ...head, hash: "0".repeat(64) }), "other");
  await isAccessible(page);
  await picture(page, "audit-other-head", true);
  await compare(JSON.stringify({ ...head, number: head.number + 1000 }), "gone");
  await compare("no head", "no_head");
  expect(faults).toEqual([]);
  await page.context().close();
});

test("without the right it says which role it needs, and a gateway that fails is told with what to do, in Chinese too", async () => {
  const { page, faults } = await openPage(browser, { locale: "zh-CN", viewport: { width: 390, height: 844 } });
  await page.goto(`${hall.url}/audit#${viewer}`);
  await says(page, "[data-no-right]", /工程师[^]*观察员/);
  await fits(page);
  await isAccessible(page);
  await page.context().close();

  const other = await openPage(browser, { locale: "zh-CN" });
  let isBroken = true;
  await other.page.route("**/v1/audit/head", (route) =>
    isBroken
      ? route.fulfill({ status: 503, json: { code: "store_unavailable", message: "the disk is full" } })
      : route.continue(),
  );
  await other.page.goto(`${hall.url}/audit?kind=stop#${engineer}`);
  await says(other.page, "[data-problem=store_unavailable]", /网关无法使用其磁盘。[^]*the disk is full/);
  await isAccessible(other.page);
  await picture(other.page, "audit-problem-zh");
  isBroken = false;
  await other.page.click("text=重试");
  await says(other.page, "[role=table]", "已停止，已确认机械臂静止。");
  await until("the problem is gone", async () => (await other.page.locator("[data-problem]").count()) === 0);
  await isAccessible(other.page);
  expect([...faults, ...other.faults]).toEqual([]);
  await other.page.context().close();
});
