/** What the page says of refusals, and of names that others gave. */
import type { Browser, Page } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { FakeGateway, openSignedIn } from "./fake.ts";
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

/** What is read and what is heard. */
function texts(page: Page): Promise<string> {
  return page.evaluate(() => {
    const labels = ["aria-label", "title", "alt", "placeholder"].flatMap((name) =>
      [...document.querySelectorAll(`[${name}]`)].map((one) => one.getAttribute(name)),
    );
    return [document.title, document.body.textContent, ...labels].join(" ");
  });
}

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

test("what the gateway refuses because the robot does not answer can be tried again, and the page says when", async () => {
  const { page, faults } = await openPage(browser);
  let isSilent = true;
  await page.route("**/v1/robots/press-1/commands", (route) =>
    isSilent
      ? route.fulfill({ status: 409, json: { code: "not_ready", message: "the robot does not answer" } })
      : route.fulfill({ status: 200, json: { command_id: 1, sent: "actionPause", after_ms: 1 } }),
  );
  await page.goto(`${hall.url}/robots/press-1#${engineer}`);
  await page.click("[data-control=pause]");
  await says(page, "[data-told-command=control]", /Pause: nothing was sent\. .* Try again in a moment\. Gateway: the robot does not/);
  expect(await page.isEnabled("[data-control=pause]")).toBe(true);
  isSilent = false;
  await page.click("[data-control=pause]");
  await says(page, "[data-told-command=control]", "Pause: accepted.");
  expect(faults).toEqual([]);
  await page.context().close();
});

test("a name that turns what stands around it is shown as it is, on the page, in labels and in the tab", async () => {
  const turned = "press\u202e4\u2066";
  const marked = "press\\u{202e}4\\u{2066}";
  const turner = await hall.token("operator", "--name", turned);
  expect((await hall.ask(turner, "POST", "/v1/robots/press-1/stop")).status).toBe(200);
  expect((await hall.ask(turner, "POST", "/v1/robots/press-1/lease", {})).status).toBe(200);
  const { page, faults } = await openPage(browser);
  const all = (): Promise<string> => texts(page);
  await page.goto(`${hall.url}/robots/press-1#${engineer}`);
  await says(page, "[data-stopped-by]", `(${marked})`);
  await says(page, "[data-lease=others]", `(${marked})`);
  expect(await page.getAttribute("[data-lease=others] button", "title")).toContain(marked);
  expect(await all()).not.toMatch(/[\u202e\u2066]/u);
  await page.goto(`${hall.url}/`);
  await says(page, "[data-robot=press-1]", marked);
  expect(await all()).not.toMatch(/[\u202e\u2066]/u);
  await page.goto(`${hall.url}/audit?robot=press-1`);
  await says(page, "[role=table] td bdi", `(${marked})`);
  expect(await all()).not.toMatch(/[\u202e\u2066]/u);
  // The name of a robot that another one gave a link with.
  await page.goto(`${hall.url}/robots/${encodeURIComponent(turned)}`);
  await says(page, "h1 bdi", marked);
  expect(await page.title()).toBe(`${marked} · r6`);
  expect(await all()).not.toMatch(/[\u202e\u2066]/u);
  await isAccessible(page);
  expect(faults).toEqual([]);
  await page.context().close();
});

test("robots, programs, alarms and people of another gateway turn no sentence, on any page", async () => {
  const fake = new FakeGateway({ robots: 12, running: 6, lost: 2, alarmed: 2, behind: "\u202e\u200b" });
  await fake.begin();
  const marked = "\\u{202e}\\u{200b}";
  const { page, faults } = await openSignedIn(browser);
  const [first, second] = [fake.robots[0]?.name ?? "", fake.robots[1]?.name ?? ""];
  const of = (name: string): string => `robots/${encodeURIComponent(name)}`;
  const history = `history?robot=${encodeURIComponent(second)}&signal=axis-0,curMold&span=1m`;
  const paths = ["", of(first), of(second), `${of(second)}/teach`, "alarms", "production", "connections", history];
  for (const language of ["en", "zh"]) {
    await page.addInitScript((chosen) => localStorage.setItem("r6-language", chosen), language);
    for (const path of paths) {
      await page.goto(`${fake.url}/${path}`);
      await says(page, "body", marked);
      // The parts that come later are there.
      await page.waitForTimeout(300);
      expect(await texts(page), path).not.toMatch(/[\u202e\u200b]/u);
    }
  }
  await page.goto(`${fake.url}/`);
  await page.click("text=停止…");
  await says(page, "[role=group]", marked);
  expect(await texts(page)).not.toMatch(/[\u202e\u200b]/u);
  expect(faults).toEqual([]);
  await page.context().close();
  await fake.end();
});
