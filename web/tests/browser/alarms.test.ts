import type { Browser } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { type Made, make } from "./made.ts";
import { Network, fits, isAccessible, openPage, picture, r6, says, sideways, startBrowser, until } from "./support.ts";

const PRESSES = ["press-01", "press-02", "press-03", "press-04"];
const HALL = '[hall]\ntime_zone = "Asia/Shanghai"\n';
let made: Made;
let browser: Browser;

beforeAll(async () => {
  [made, browser] = await Promise.all([make({ names: ["pack-01", ...PRESSES], more: HALL }), startBrowser()]);
});

afterAll(async () => {
  await browser?.close();
  await made?.end();
});

async function panel(controllers: number[], ...words: string[]): Promise<void> {
  await Promise.all(controllers.map((one) => r6("panel", "--panel", made.panel, "--controller", String(one), ...words)));
}

const LINE = "[data-line=alarm]";

test("alarms are explained, grouped, acknowledged, shelved with a reason, and found again", async () => {
  const { page, faults } = await openPage(browser, { timezoneId: "America/Los_Angeles" });
  await page.goto(`${made.url}/alarms#${await made.token("engineer")}`);
  await says(page, "[data-now=none]", "No robot needs a person. No alarm of the last day is known.");
  await says(page, "[data-pareto=empty]", "No alarm was read in this span.");
  await isAccessible(page);

  // One cause at many robots is one line.
  await panel([2, 3, 4, 5], "estop");
  await says(page, `${LINE}[data-robots='4']`, /alarm 7: 4 robots within 2 s: emergency stop\s+What to do: make the cell safe/);
  await page.click("text=Acknowledge all 4");
  await says(page, "[data-told-alarms]", "Acknowledged 4 of 4");
  await page.click(`${LINE} summary`);
  await says(page, `${LINE} details`, /press-01\s+Seen by token 1[^]*press-04\s+Seen by token 1/);

  await panel([1], "alarm", "850");
  const pack = `${LINE}:has([data-shelve=pack-01])`;
  // Nothing moves under a pointer: what is new is counted, and waits.
  await says(page, "#now", "1 new");
  await page.click("#shelved");
  await says(page, pack, /pack-01\s+alarm 850: /);
  expect(await page.locator(LINE).first().textContent(), "it is not acknowledged, so it stands first").toContain("pack-01");
  await page.click("[data-shelve=pack-01]");
  await page.waitForSelector("[role=dialog]");
  expect(await page.isDisabled("[role=dialog] [type=submit]"), "without a reason").toBe(true);
  await isAccessible(page);
  await page.fill("[name=reason]", "the door switch is being mended");
  await page.selectOption("[name=for]", "120");
  await picture(page, "alarms-shelve");
  await page.click("[role=dialog] [type=submit]");
  await says(page, "[data-shelved=pack-01]", /Reason: the door switch is being mended[^]*by token 1[^]*until/);
  // The end is told on the clock of the hall, and the browser is in another zone.
  const end = new Date(Date.now() + 2 * 3_600_000).toLocaleTimeString("sv-SE", { timeZone: "Asia/Shanghai" }).slice(0, 2);
  await says(page, "[data-shelved=pack-01]", new RegExp(`until (\\d{4}-\\d\\d-\\d\\d )?${end}:`));
  await page.waitForSelector(pack, { state: "detached" });
  await says(page, "section:has(#now)", "1 alarm is shelved");

  // The last day, by robot. What is chosen stands in the address.
  await until("all five are listed", async () => (await page.locator("[data-day-alarm]").count()) === 5);
  await page.locator("label:has-text('Robot') select").selectOption("pack-01");
  await until("one is left", async () => (await page.locator("[data-day-alarm]").count()) === 1);
  expect(new URL(page.url()).search).toBe("?robot=pack-01");
  await page.locator("label:has-text('Robot') select").selectOption("");
  await page.getByRole("group", { name: "Span" }).getByText("8 h").click();
  await says(page, "[data-cost='7']", /7: emergency stop[^]*%[^]*4[^]*press-01, press-02/);
  await isAccessible(page);
  for (const [theme, width] of [["light", 1920], ["dark", 768]] as const) {
    await page.emulateMedia({ colorScheme: theme });
    await page.setViewportSize({ width, height: 1080 });
    await fits(page);
    await picture(page, `alarms-${width}-${theme}`, true);
  }
  await isAccessible(page);

  await page.getByRole("button", { name: "Take off the shelf" }).click();
  await says(page, "section:has(#shelved)", "Nothing is shelved.");
  await says(page, pack, "alarm 850");
  await panel([2, 3, 4, 5], "release");
  await panel([1, 2, 3, 4, 5], "clear");
  await says(page, "[data-now=none]", /No robot needs a person\. The last alarm that was seen ended \d\d:\d\d:\d\d/);
  expect(faults).toEqual([]);
  await page.context().close();
});

test("a viewer reads it on a phone in Chinese, and what a role does not allow is off", async () => {
  await panel([1], "estop");
  const { page, faults } = await openPage(browser, { viewport: { width: 390, height: 844 }, locale: "zh-CN", hasTouch: true });
  const { hostname, port } = new URL(made.url);
  const network = new Network({ host: hostname, port: Number(port) });
  await page.goto(`${await network.open()}/alarms#${await made.token("viewer")}`);
  await says(page, "section:has(#now)", /当前停机原因[^]*pack-01[^]*报警 7[^]*处理方法/);
  expect(await page.isDisabled("[data-acknowledge=pack-01]")).toBe(true);
  expect(await page.getAttribute("[data-shelve=pack-01]", "title")).toBe("搁置需要工程师角色。");
  await says(page, "[data-cost='7']", "7: 急停");
  await page.waitForSelector("[data-day-alarm=pack-01]");
  expect(await sideways(page), "rows are cards").toEqual([]);
  await says(page, "[data-day-alarm=pack-01] td.whole", "7: 急停");
  await fits(page);
  await isAccessible(page);
  await picture(page, "alarms-390-zh", true);
  // A question that is refused is told with its code and with what to do.
  await page.route("**/production?*", (route) => route.fulfill({ status: 503, json: { code: "store_unavailable", message: "the disk fails" } }));
  await page.getByRole("group", { name: "时间范围" }).getByText("7 天").tap();
  await says(page, "[data-problem=store_unavailable]", /网关[^]*磁盘[^]*store_unavailable[^]*the disk fails/);
  await isAccessible(page);
  // Without the gateway nothing is said of now.
  await network.cut();
  await says(page, "[data-now=unknown]", "收不到网关的数据，当前停机原因未知。");
  await says(page, "section:has(#now) ol.hatched", "pack-01");
  expect(faults).toEqual([]);
  await page.context().close();
});
