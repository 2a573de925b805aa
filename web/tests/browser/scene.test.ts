import type { Browser, Page } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { make } from "./made.ts";
import {
  type Cell,
  SOFTWARE_3D,
  fits,
  isAccessible,
  openPage,
  picture,
  r6,
  says,
  startBrowser,
  startCell,
  until,
} from "./support.ts";

let cell: Cell;
let browser: Browser;

beforeAll(async () => {
  [cell, browser] = await Promise.all([startCell(), startBrowser(SOFTWARE_3D)]);
});

afterAll(async () => {
  await browser?.close();
  await cell?.up.kill();
});

const SHOWN = "[data-scene=shown] canvas";

/** How often the picture was drawn. */
async function drawn(page: Page): Promise<number> {
  return Number((await page.getAttribute(SHOWN, "data-drawn")) ?? 0);
}

/** Waits until nothing is drawn any more, and takes the pixels of the picture. */
async function pixels(page: Page): Promise<string> {
  let before = -1;
  await until("the picture is still", async () => {
    const now = await drawn(page);
    const isStill = now === before;
    before = now;
    await page.waitForTimeout(200);
    return isStill;
  });
  return (await page.locator(SHOWN).screenshot()).toString("base64");
}

test("the picture follows the arm, and the table says the same", async () => {
  const { page, faults } = await openPage(browser, { viewport: { width: 1280, height: 900 } });
  await page.goto(cell.link);
  await page.click("[data-robot=virtual]");
  await page.waitForSelector(SHOWN);
  await says(page, "[data-value=axis-0]", /^0\.000$/);
  const first = await pixels(page);
  const still = await drawn(page);
  // The page hears of the robot, and nothing of it is in the picture.
  await page.click("text=Take control");
  await page.waitForSelector("[data-lease=mine]");
  await page.click("text=Give back");
  await page.waitForSelector("[data-lease=free]");
  await page.waitForTimeout(300);
  expect(await drawn(page), "nothing is drawn while the arm stands").toBe(still);
  await r6("-r", cell.robot, "move", "axes", "60", "-20", "20", "0", "-40", "0", "--speed", "20", "--wait");
  await says(page, "[data-value=axis-0]", /^60\.000$/);
  const moved = await pixels(page);
  expect(moved === first, "the pixels changed").toBe(false);
  expect(await drawn(page), "it went there in steps").toBeGreaterThan(still + 3);
  expect(Number(await page.getAttribute(SHOWN, "data-triangles"))).toBeLessThan(4_000);

  // The views and the keys turn it, and one way back is the same picture.
  await page.click("[data-view=top]");
  const top = await pixels(page);
  expect(top === moved).toBe(false);
  await page.focus("[role=application]");
  await page.keyboard.press("ArrowLeft");
  const turned = await pixels(page);
  expect(turned === top).toBe(false);
  for (const view of ["side", "tool", "iso"]) await page.click(`[data-view=${view}]`);
  await isAccessible(page);
  await fits(page);
  expect(faults).toEqual([]);
  await page.context().close();
});

test("it has the colours of the theme, fits a phone, and is gone with the page", async () => {
  const { page, faults } = await openPage(browser, { viewport: { width: 1920, height: 1080 }, locale: "zh-CN" });
  await page.goto(cell.link);
  await page.click("[data-robot=virtual]");
  await page.waitForSelector(SHOWN);
  await says(page, "[data-view=top]", "俯视");
  for (const theme of ["light", "dark"] as const) {
    await page.emulateMedia({ colorScheme: theme });
    await until(theme, async () => (await page.getAttribute("html", "data-theme")) === theme);
    for (const width of [1920, 768, 390]) {
      await page.setViewportSize({ width, height: width === 390 ? 844 : width === 768 ? 1024 : 1080 });
      await fits(page);
      if (width === 1920) await pixels(page);
      await picture(page, `robot-3d-${width}-${theme}`, width !== 1920);
    }
    await isAccessible(page);
  }
  // On narrow screens the parts are behind buttons, and the address keeps which one.
  await page.click("[data-tab=axes]");
  await page.waitForSelector("[data-value=axis-0]");
  expect(new URL(page.url()).search).toBe("?tab=axes");
  await page.click("text=车间");
  await page.waitForSelector("[data-robot=virtual]");
  expect(await page.locator("canvas").count()).toBe(0);
  expect(faults).toEqual([]);
  await page.context().close();
});

test("a lost picture says so and comes back; without WebGL there is a sentence", async () => {
  const { page, faults } = await openPage(browser, { viewport: { width: 1280, height: 900 } });
  await page.goto(cell.link);
  await page.click("[data-robot=virtual]");
  await page.waitForSelector(SHOWN);
  await page.evaluate(() => {
    const canvas = document.querySelector("canvas")!;
    canvas.getContext("webgl2")!.getExtension("WEBGL_lose_context")!.loseContext();
  });
  await says(page, "[data-scene=lost]", "The picture was lost");
  await isAccessible(page);
  await page.click("text=Show it again");
  await page.waitForSelector(SHOWN);
  expect(faults).toEqual([]);
  await page.context().close();

  const other = await openPage(browser, { viewport: { width: 1280, height: 900 } });
  await other.page.addInitScript(() => {
    HTMLCanvasElement.prototype.getContext = () => null;
  });
  await other.page.goto(cell.link);
  await other.page.click("[data-robot=virtual]");
  await says(other.page, "[data-scene=graphics]", "WebGL is missing or switched off");
  await says(other.page, "[data-value=axis-0]", /^\d+\.000$/);
  expect(other.faults).toEqual([]);
  await other.page.context().close();
});

test("an arm that is not read is seen through, and then not shown", async () => {
  const own = await startCell();
  try {
    const { page, faults } = await openPage(browser, { viewport: { width: 1280, height: 900 } });
    await page.goto(own.link);
    await page.click("[data-robot=virtual]");
    await page.waitForSelector(SHOWN);
    await says(page, "[data-value=axis-0]", /^0\.000$/);
    expect(await page.textContent("[data-over]")).toBe("");
    const fresh = await pixels(page);
    await own.up.kill();
    await says(page, "[data-over]", / s old$/);
    const old = await pixels(page);
    expect(old === fresh).toBe(false);
    await says(page, "[data-over]", "Where the arm stands is not known.");
    expect((await pixels(page)) === old).toBe(false);
    await says(page, "[data-value=axis-0]", /^-$/);
    expect(faults).toEqual([]);
    await page.context().close();
  } finally {
    await own.up.kill();
  }
});

test("the space of a guard is in the picture, and all its limits are in a list beside it", async () => {
  const guard = "[robot.guard]\nmax_speed = 50\n[robot.guard.axes]\nJ1 = [-90, 90]\n[robot.guard.workspace]\nz = [300, 900]\n";
  // The table of the guard follows that of the last robot.
  const more = (model: string): string => `model = "${model}"\n${guard}`;
  const made = await make({ names: ["saw", "press"], more: more("BRTIRUS0707A") });
  try {
    const { page, faults } = await openPage(browser, { viewport: { width: 1280, height: 900 } });
    await page.goto(`${made.url}/robots/press#${await made.token("viewer")}`);
    await page.waitForSelector(SHOWN);
    await says(page, "[data-guard]", /Z: 300 to 900 mm\s*J1: -90 to 90 °\s*Speed of a move: 50 % at most/);
    await says(page, "[data-lines=guard]", "The dashed box is the workspace");
    await pixels(page);
    await picture(page, "robot-guard");
    await isAccessible(page);
    // Without a guard there is neither.
    await page.goto(`${made.url}/robots/saw`);
    await page.waitForSelector("[data-value=axis-0]");
    expect(await page.locator("[data-guard]").count()).toBe(0);
    expect(faults).toEqual([]);
    await page.context().close();
  } finally {
    await made.end();
  }
});
