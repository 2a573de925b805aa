import { GAP, SETTLE } from "../../src/ui/hold.ts";
import type { Browser } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { type Cell, fits, isAccessible, openPage, picture, r6, says, startBrowser, startCell, until } from "./support.ts";

let cell: Cell;
let browser: Browser;

beforeAll(async () => {
  [cell, browser] = await Promise.all([startCell(), startBrowser()]);
});

afterAll(async () => {
  await browser?.close();
  await cell?.up.kill();
});

const STOP = "[data-stop=virtual]";
const TOLD = "[data-told]";

test("an operator signs in with the link, sees an axis move, stops the arm and starts it again", async () => {
  const { page, faults } = await openPage(browser);
  await page.goto(cell.link);
  await says(page, "[data-robot=virtual]", /VIRTUAL 虚拟[^]*running/);
  expect(page.url(), "the secret is not in the address any more").toBe(`${cell.gateway}/`);
  await isAccessible(page);
  await page.click("[data-robot=virtual]");
  await says(page, "[data-doing]", "The program runs.");
  expect(await page.title()).toBe("VIRTUAL 虚拟 · virtual · r6");
  await page.waitForSelector('[data-point="input 1"]');
  await isAccessible(page);

  // The numbers follow the arm.
  const seen = new Set<string>();
  await page.exposeFunction("axisIs", (text: string) => seen.add(text));
  await page.evaluate(() => {
    const axis = document.querySelector("[data-value=axis-0]");
    const tell = (window as unknown as { axisIs(text: string): void }).axisIs;
    new MutationObserver(() => tell(axis?.textContent ?? "")).observe(axis!, { childList: true, subtree: true, characterData: true });
  });
  await r6("-r", cell.robot, "move", "axes", "30", "0", "0", "0", "30", "0", "--speed", "8", "--wait");
  await says(page, "[data-value=axis-0]", /^30\.000$/);
  const between = [...seen].filter((text) => Number(text) > 0.5 && Number(text) < 29.5);
  expect(between.length, [...seen].join(" ")).toBeGreaterThan(3);

  // A second person sees who controls it, and can stop it all the same.
  await page.click("text=Take control");
  await page.waitForSelector("[data-lease=mine]");
  const other = await openPage(browser);
  await other.page.goto(cell.link);
  await other.page.waitForSelector("[data-robot=virtual]");
  await other.page.goto(`${cell.gateway}/robots/virtual`);
  await other.page.waitForSelector("[data-lease=others]");
  await says(other.page, "[data-lease]", /1 \(r6 up\) controls it/);
  expect(await other.page.isDisabled("text=Take control")).toBe(true);
  expect(await other.page.isDisabled("[data-control=start]")).toBe(true);

  // Stop acts on press, before the button is let go.
  const box = (await other.page.locator(STOP).boundingBox())!;
  await other.page.mouse.move(box.x + 5, box.y + 5);
  await other.page.mouse.down();
  await says(other.page, TOLD, /virtual: stopped, seen \d\d:\d\d:\d\d/);
  await other.page.mouse.up();
  await other.page.context().close();
  await says(page, "[data-doing]", "It waits for you to clear the stop.");
  expect(await page.isDisabled("[data-control=start]")).toBe(true);
  await page.click("[data-control=clear_stop]");
  await says(page, "[data-told-command]", "Clear stop: done.");

  // Behind a dialog, with the key and with the button.
  await page.click("[data-control=start]");
  await page.waitForSelector("[role=dialog]");
  await isAccessible(page);
  await picture(page, "prepare");
  await page.keyboard.press("F9");
  await says(page, TOLD, "stopped, seen");
  await says(page, "[role=dialog]", "clear the stop first");
  await page.click(STOP);
  await until("a stop is sent from behind the dialog", async () => (await page.getAttribute(TOLD, "data-told")) === "stopped");
  await page.click("text=Cancel");
  await page.click("[data-control=clear_stop]");
  await says(page, "[data-told-command]", "Clear stop: done.");

  // What moves takes two steps. A short press starts nothing.
  await page.click("[data-control=start]");
  await page.click("text=Hold to run virtual");
  await says(page, "[data-lack=longer]", "Hold it for 1 s.");
  expect(await page.getAttribute("[data-mode]", "data-mode")).not.toBe("7");
  const hold = (await page.locator("text=Hold to run virtual").boundingBox())!;
  await page.mouse.move(hold.x + 5, hold.y + 5);
  await page.mouse.down();
  await page.waitForSelector("[data-mode='7']");
  await page.mouse.up();
  await says(page, "[data-told-command]", "Start: accepted. The values");

  // An alarm that follows is said where the start was.
  await r6("panel", "--panel", cell.panel, "alarm", "850");
  await says(page, "[data-told-command]", "Start: accepted. Within half a minute alarm 850 came");
  await page.click("[data-control=clear_alarm]");
  await says(page, "[data-told-command]", "Clear alarm: the controller accepted it.");
  await says(page, "[data-doing]", /^(?!.*Alarm 850)/s);

  await page.click("text=Give back");
  await page.waitForSelector("[data-lease=free]");
  await fits(page);
  expect(faults).toEqual([]);
  await page.context().close();
});

test("the question before a start tells the global speed that the page tells, and closes if it is another one", async () => {
  await r6("panel", "--panel", cell.panel, "button", "stop");
  await r6("-r", cell.robot, "command", "modifyGSPD", "10");
  const { page, faults } = await openPage(browser);
  await page.goto(`${cell.gateway}/robots/virtual${new URL(cell.link).hash}`);
  await page.click("text=Take control");
  await page.waitForSelector("[data-lease=mine]");
  await says(page, "[data-speed]", /\b10 %/);
  await page.click("[data-control=start]");
  await says(page, "[data-told-speed]", /\b10 %/);
  await r6("-r", cell.robot, "command", "modifyGSPD", "100");
  await page.waitForSelector("[role=dialog]", { state: "detached" });
  await says(page, "[data-told-command]", "Not started: the global speed is another one now");
  await page.click("[data-control=start]");
  await says(page, "[data-told-speed]", /\b100 %/);
  expect(faults).toEqual([]);
  await page.context().close();
});

test("the link that signs in works in a tab that shows the page already, and is taken out of the address", async () => {
  const { page, faults } = await openPage(browser);
  await page.goto(`${cell.gateway}/`);
  await page.waitForSelector("input");
  await page.evaluate((hash) => void (location.hash = hash), new URL(cell.link).hash);
  await page.waitForSelector("[data-robot=virtual]");
  expect(page.url()).toBe(`${cell.gateway}/`);
  // The same link again changes nothing.
  await page.evaluate((hash) => void (location.hash = hash), new URL(cell.link).hash);
  await page.waitForFunction(() => location.hash === "");
  await page.waitForSelector("[data-robot=virtual]");
  expect(faults).toEqual([]);
  await page.context().close();
});

test("an alarm stands first in the hall, is explained, acknowledged and cleared", async () => {
  const { page, faults } = await openPage(browser);
  await page.goto(cell.link);
  await page.waitForSelector("[data-robot=virtual]");
  await r6("panel", "--panel", cell.panel, "estop");
  await says(page, "ol", /virtual\s+alarm 7: emergency stop/);
  await isAccessible(page);
  await page.click("text=Open");
  await says(page, "[data-alarm='7']", /emergency stop[^]*What to do/);
  await page.click("text=Acknowledge");
  await says(page, "[data-alarm='7']", "Seen by token 1 (r6 up)");
  await r6("panel", "--panel", cell.panel, "release");
  await page.click("text=Take control");
  await page.click("[data-control=clear_alarm]");
  await says(page, "[data-told-command=control]", "Clear alarm: the controller accepted it.");
  await says(page, "[data-alarm='7']", "until");
  await page.click("text=Give back");
  await page.click("text=Hall");
  await says(page, "main", "No robot needs a person.");
  expect(faults).toEqual([]);
  await page.context().close();
});

test("the start also works with keys: Enter twice, and a phone in Chinese shows it all", async () => {
  const { page, faults } = await openPage(browser, { viewport: { width: 390, height: 844 }, locale: "zh-CN", hasTouch: true });
  await page.goto(cell.link);
  await says(page, "[data-robot=virtual]", "虚拟");
  await fits(page);
  await isAccessible(page);
  await page.tap("[data-robot=virtual]");
  await page.waitForSelector("[data-doing]");
  await page.tap("text=获取控制权");
  await page.waitForSelector("[data-lease=mine]");
  await page.tap(STOP);
  await says(page, TOLD, "virtual：已停止");
  await page.tap("[data-control=clear_stop]");
  await says(page, "[data-told-command]", "解除停止：完成。");
  await page.tap("[data-control=start]");
  await says(page, "[role=dialog]", "启动 virtual？");
  await isAccessible(page);
  // The dialog gives the focus to the button, whatever opened it. Presses count from then on when it was there for a
  // moment. One long press is one press, however often the key repeats.
  await page.waitForTimeout(SETTLE + 100);
  for (let at = 0; at < 5; at += 1) await page.keyboard.down("Enter");
  await page.keyboard.up("Enter");
  await says(page, "[data-lack=again]", "请再按一次。");
  expect(await page.getAttribute("[data-mode]", "data-mode")).not.toBe("7");
  // Between the presses the key is up for a moment.
  await page.waitForTimeout(GAP + 100);
  await page.keyboard.press("Enter");
  await page.waitForSelector("[data-mode='7']");
  await says(page, "[data-doing]", "正在运行");
  await fits(page);
  await isAccessible(page);
  // A missing glyph would be a box: the font of the tests has the characters of the page.
  expect(await page.evaluate(() => document.fonts.check('14px "WenQuanYi Micro Hei"', "获取控制权"))).toBe(true);
  expect(await page.evaluate(() => document.documentElement.lang)).toBe("zh-Hans");
  await page.tap("text=交还");
  await page.waitForSelector("[data-lease=free]");
  expect(faults).toEqual([]);
  await page.context().close();
});
