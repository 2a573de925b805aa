/** A program for more axes than the arm has: it is said before anything is prepared. */
import type { Browser } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { type Made, make } from "./made.ts";
import { isAccessible, openPage, picture, says, startBrowser } from "./support.ts";

let made: Made;
let browser: Browser;
let url = "";
let engineer = "";

const move = (...to: number[]): string => `[[instruction]]\ndo = "axis-move"\nto = [${to.join(", ")}]\nspeed = 40\n`;

beforeAll(async () => {
  // The model of the last one is known to the gateway, too.
  const wanted = { names: ["bare", "pack"], sim: ["--model", "GENERIC-SCARA"], more: 'model = "GENERIC-SCARA"\n' };
  [made, browser] = await Promise.all([make(wanted), startBrowser()]);
  url = made.url;
  engineer = await made.token("engineer");
  for (const [name, program] of [
    ["six", move(5, 0, 0, 0, 0, 0) + move(10, 0, 0, 0, 30, 5)],
    ["four", move(5, 0, 0, 0)],
  ]) {
    const headers = { Authorization: `Bearer ${engineer}`, "Content-Type": "application/json", "If-None-Match": "*" };
    const stored = await fetch(`${url}/v1/programs/${name}`, { method: "PUT", headers, body: JSON.stringify({ program }) });
    expect(stored.status).toBe(201);
  }
});

afterAll(async () => {
  await browser?.close();
  await made?.end();
});

test("a program for six axes has a mistake beside its step on an arm of four, and is not prepared", async () => {
  const { page, faults } = await openPage(browser);
  const ran: string[] = [];
  page.on("request", (request) => {
    if (request.url().endsWith("/programs/run")) ran.push(request.url());
  });
  await page.goto(`${url}/#${engineer}`);
  // With a model, and by what the controller tells.
  for (const robot of ["pack", "bare"]) {
    await page.waitForSelector(`[data-robot=${robot}]`);
    await page.goto(`${url}/robots/${robot}/teach/six`);
    await says(page, "[data-step='2'] .problem", "This robot has 4 axes: it has no J5 and no J6. Leave them out, or write 0.");
    expect(await page.getAttribute("[data-step='2']", "data-mark")).toBe("mistake");
    expect(await page.getAttribute("[data-step='1']", "data-mark"), "zeros move nothing").toBe("ok");
    await says(page, "[data-reasons~=too_many_axes]", "the program moves axes that this robot does not have");
    expect(await page.isDisabled("[data-prepare]")).toBe(true);
    await isAccessible(page);
    await picture(page, `teach-axes-${robot}`, true);

    await page.goto(`${url}/robots/${robot}`);
    await page.locator("[data-lease=free] button").click();
    await page.waitForSelector("[data-lease=mine]");
    await page.selectOption("[data-program]", "six");
    await page.click("[data-prepare]");
    await says(page, "[data-beyond-axes='2']", "step 2: This robot has 4 axes: it has no J5 and no J6.");
    await says(page, "[data-refused]", "Not prepared: the program moves axes that this robot does not have");
    expect(await page.locator("[data-prepared]").count()).toBe(0);
    // What it can run is prepared as before.
    await page.selectOption("[data-program]", "four");
    await page.click("[data-prepare]");
    await says(page, "[data-prepared]", `Run on ${robot}?`);
    await page.locator("[data-lease=mine] button").click();
    await page.waitForSelector("[data-lease=free]");
    await page.goto(`${url}/`);
  }
  expect(ran).toEqual([]);
  expect(faults).toEqual([]);
  await page.context().close();
});
