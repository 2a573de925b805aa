import { readFileSync, readdirSync } from "node:fs";
import type { Browser } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { looks } from "./gateway.ts";
import { type Cell, fits, isAccessible, openPage, picture, says, startBrowser, startCell } from "./support.ts";

let cell: Cell;
let browser: Browser;

beforeAll(async () => {
  [cell, browser] = await Promise.all([startCell(), startBrowser()]);
});

afterAll(async () => {
  await browser?.close();
  await cell?.up.kill();
});

test("the page of components has each of their states, in both themes and both languages", async () => {
  const { page, faults } = await openPage(browser);
  await page.goto(cell.link);
  await page.waitForSelector("[data-robot=virtual]");
  await page.goto(`${cell.gateway}/gallery`);
  await page.waitForSelector("[data-as-of]");
  const parts = readdirSync(new URL("../../src/ui/", import.meta.url)).filter((name) => /^[A-Z].*\.svelte$/.test(name));
  const shown = readFileSync(new URL("../../src/pages/gallery/GalleryPage.svelte", import.meta.url), "utf8");
  // Parts of the bar are on every page, and the arm in 3D on those of robots.
  const elsewhere = ["Bar.svelte", "Menu.svelte", "StopMany.svelte", "NewBuild.svelte", "ArmScene.svelte"];
  expect(parts.filter((name) => !elsewhere.includes(name) && !shown.includes(`ui/${name}`))).toEqual([]);
  await page.locator("text=Hold for 1 s").first().hover();
  await page.mouse.down();
  await page.waitForSelector("[data-held='1']");
  await page.mouse.up();
  await looks(page, "gallery");
  await page.click("text=Open a dialog");
  await isAccessible(page);
  await picture(page, "gallery-dialog");
  await page.keyboard.press("Escape");
  await page.click("details summary:has-text('operator')");
  await page.locator(".menu select").first().selectOption("zh");
  await says(page, "h1", "组件");
  await isAccessible(page);
  await fits(page);
  expect(faults).toEqual([]);
  await page.context().close();
});
