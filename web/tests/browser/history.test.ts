import { readFileSync } from "node:fs";
import type { Browser, Page } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { type Made, make } from "./made.ts";
import { fits, isAccessible, openPage, picture, says, sideways, startBrowser, until } from "./support.ts";

const DAYS = '["mon", "tue", "wed", "thu", "fri", "sat", "sun"]';
const HALL = `[hall]
time_zone = "Asia/Shanghai"
[[shift]]
name = "early"
days = ${DAYS}
begin = "00:00"
end = "12:00"
[[shift]]
name = "late"
days = ${DAYS}
begin = "12:00"
end = "24:00"
`;
/** A cycle of about a second, and a part in each. */
const PROGRAM = `
[[step]]
do = "axis-move"
to = [10, 0, 0, 0, -10, 0]
speed = 60

[[step]]
do = "axis-move"
to = [-10, 0, 0, 0, 10, 0]
speed = 60

[[step]]
do = "counter"
number = 0
by = 1
`;
let made: Made;
let browser: Browser;

beforeAll(async () => {
  [made, browser] = await Promise.all([make({ names: ["pack-01", "press-01"], old: ["old-01"], program: PROGRAM, more: HALL }), startBrowser()]);
});

afterAll(async () => {
  await browser?.close();
  await made?.end();
});

/** How many pixels of a chart have a colour that is no grey. */
async function coloured(page: Page, chart: string): Promise<number> {
  return page.locator(`[data-chart='${chart}'] canvas`).first().evaluate((node) => {
    const canvas = node as HTMLCanvasElement;
    const { data } = canvas.getContext("2d")!.getImageData(0, 0, canvas.width, canvas.height);
    let count = 0;
    for (let at = 0; at < data.length; at += 4) {
      const [r, g, b] = [data[at]!, data[at + 1]!, data[at + 2]!];
      if (Math.max(r, g, b) - Math.min(r, g, b) > 40) count += 1;
    }
    return count;
  });
}

async function downloaded(page: Page, act: () => Promise<void>): Promise<{ name: string; bytes: Buffer }> {
  const [download] = await Promise.all([page.waitForEvent("download"), act()]);
  return { name: download.suggestedFilename(), bytes: readFileSync(await download.path()) };
}

test("where values of a span are gone, their averages are drawn and told", async () => {
  const { page, faults } = await openPage(browser);
  const asked: string[] = [];
  // A day of which minutes are left: buckets that are narrower, or begin between two minutes, have nothing of them.
  await page.route(/v1\/robots\/.*\/history\?/, async (route) => {
    const query = new URL(route.request().url()).searchParams;
    const [from, to, width] = [Date.parse(query.get("from")!), Date.parse(query.get("to")!), Number(query.get("bucket")!.slice(0, -2))];
    asked.push(query.get("bucket")!);
    const fits = width % 60_000 === 0 && from % 60_000 === 0;
    const starts = Array.from({ length: Math.ceil((to - from) / width) }, (_, at) => from + at * width);
    const buckets = starts.map((start, at) => {
      const mean = fits ? 20 + Math.sin(at / 3) : null;
      return { time: new Date(start).toISOString(), mean, min: mean, max: mean, last: null, good_ms: fits ? Math.min(width, to - start) : 0, samples: fits ? 9 : 0 };
    });
    const part = (begin: number, end: number, used: string) => ({ from: new Date(begin).toISOString(), to: new Date(end).toISOString(), width_ms: 60_000, used });
    const averages = [part(from, to, fits ? "incomplete" : "not_used")];
    const head = { robot: "pack-01", signal: query.get("signal"), unit: "deg", from: query.get("from"), to: query.get("to"), bucket_ms: width };
    await route.fulfill({ json: { ...head, buckets, kept_until: null, unreadable_chunks: 0, averages, next_cursor: null } });
  });
  await page.goto(`${made.url}/history?robot=pack-01&signal=axis-0&span=15m#${await made.token("viewer")}`);
  await says(page, "figure", "values are gone, averages of 1 min are left. They lack some of the values.");
  expect(asked.some((width) => Number(width.slice(0, -2)) < 60_000), "first as wide as a pixel").toBe(true);
  expect(asked.some((width) => width === "60000ms"), "then as wide as an average").toBe(true);
  expect(await coloured(page, "axis-0")).toBeGreaterThan(200);
  expect(await page.locator("[data-empty]").count()).toBe(0);
  await picture(page, "history-averages", true);
  expect(faults).toEqual([]);
  await page.context().close();
});

test("the history is chosen, drawn, said as a table, told as events, and saved", async () => {
  const { page, faults } = await openPage(browser, { timezoneId: "America/Los_Angeles" });
  await page.goto(`${made.url}/history#${await made.token("viewer")}`);
  await says(page, "[data-history=choose]", "Choose a robot and a signal.");
  await isAccessible(page);
  const [robots, signals] = ["Robots", "Signals"].map((name) => page.getByRole("group", { name }).getByRole("combobox"));
  await robots!.selectOption("pack-01");
  await signals!.selectOption({ label: "J1" });
  await signals!.selectOption({ label: "J5" });
  await page.click("[data-span='1m']");
  expect(new URL(page.url()).search).toBe("?robot=pack-01&signal=axis-0%2Caxis-4&span=1m");

  const CHART = "axis-0 axis-4";
  await page.waitForSelector(`[data-chart='${CHART}'][data-reading=false]`);
  await until("lines are drawn", async () => (await coloured(page, CHART)) > 200);
  // The table says the same: what was before the first value is a gap, and no 0.
  await says(page, `[data-chart='${CHART}'] tbody`, /no value[^]*no value[^]*-?\d+\.\d+ \(-10[^]*… 10/);
  await says(page, `[data-chart='${CHART}']`, /This span has no value before \d\d:\d\d:\d\d/);
  const hour = new Date().toLocaleTimeString("sv-SE", { timeZone: "Asia/Shanghai" }).slice(0, 2);
  expect(await page.locator(`[data-chart='${CHART}'] tbody tr:last-child th`).textContent()).toMatch(new RegExp(`^(${hour}|\\d{4}-)`));
  // It goes on by itself.
  const last = await page.textContent(`[data-chart='${CHART}'] tbody tr:last-child`);
  await until("the tail is live", async () => (await page.textContent(`[data-chart='${CHART}'] tbody tr:last-child`)) !== last);

  await page.locator("label:has-text('Show') select").selectOption("cycles");
  await says(page, "[data-event=cycle_done]", /pack-01[^]*1 cycle done, 1\.\d\d s/);
  await isAccessible(page);
  for (const [theme, width] of [["light", 1920], ["dark", 768]] as const) {
    await page.emulateMedia({ colorScheme: theme });
    await page.setViewportSize({ width, height: 1080 });
    await fits(page);
    await page.waitForTimeout(50);
    await picture(page, `history-${width}-${theme}`, true);
  }
  await isAccessible(page);

  const csv = await downloaded(page, () => page.click("[data-csv='pack-01 axis-0']"));
  expect(csv.name).toMatch(/^pack-01-axis-0-\d{4}-\d\d-\d\dT\d{4}\.csv$/);
  const lines = csv.bytes.toString().trim().split("\r\n");
  expect(lines[0]).toBe("time,value,gap");
  expect(lines.length).toBeGreaterThan(10);
  const parquet = await downloaded(page, () => page.click("[data-parquet='pack-01 axis-0']"));
  expect([parquet.bytes.subarray(0, 4).toString(), parquet.bytes.subarray(-4).toString()]).toEqual(["PAR1", "PAR1"]);
  await says(page, "[data-exported]", `Saved as ${parquet.name}.`);

  // A span of one's own is one of the hall's clock, and before the first value there is nothing.
  await page.click("[data-span=own]");
  await page.fill("[name=from]", "2026-01-02T06:00");
  await page.fill("[name=to]", "2026-01-02T05:00");
  const show = page.getByRole("button", { name: "Show", exact: true });
  await show.click();
  await says(page, "form [role=alert]", "The end has to be behind the begin");
  await page.fill("[name=to]", "2026-01-02T07:00");
  const [asked] = await Promise.all([page.waitForRequest(/history\?signal=axis-0/), show.click()]);
  expect(new URL(asked.url()).searchParams.get("from")).toBe("2026-01-01T22:00:00.000Z");
  await says(page, `[data-chart='${CHART}'] [data-empty]`, "No value was kept in this span.");
  expect(faults).toEqual([]);
  await page.context().close();
});

test("the page of a robot has its charts; a phone shows the history in Chinese", async () => {
  const { page, faults } = await openPage(browser, { viewport: { width: 390, height: 844 }, locale: "zh-CN", hasTouch: true });
  await page.goto(`${made.url}/robots/pack-01#${await made.token("viewer")}`);
  const AXES = "axis-0 axis-1 axis-2 axis-3 axis-4 axis-5";
  expect(await page.locator("[data-chart]").count(), "what is not seen asks nothing").toBe(0);
  await page.tap("[data-tab=charts]");
  await page.waitForSelector(`[data-chart='${AXES}'][data-reading=false]`);
  await until("lines are drawn", async () => (await coloured(page, AXES)) > 20);
  await fits(page);
  await page.tap("text=在历史页面查看更多信号和机器人");
  await page.waitForSelector(`[data-chart='${AXES}'][data-reading=false]`);
  await says(page, "main", /时间范围|1 分钟/);
  await says(page, "[aria-labelledby=happened]", "发生的事件");
  await fits(page);
  await isAccessible(page);
  await picture(page, "history-390-zh", true);
  expect(faults).toEqual([]);
  await page.context().close();
});

test("today's cycles are compared with yesterday's, in the time of the hall, wherever the browser is", async () => {
  const { page, faults } = await openPage(browser, { timezoneId: "America/Los_Angeles" });
  const zone = { timeZone: "Asia/Shanghai" };
  const day = (back: number): string => new Date(Date.now() - back * 86_400_000).toLocaleDateString("sv-SE", zone);
  const midnight = (of: string): string => `${new Date(Date.parse(`${of}T00:00:00+08:00`)).toISOString()}`;
  // Nothing was kept yesterday: what the gateway would say of it is made of what it says of today.
  const asked: URL[] = [];
  await page.route(/production\?from=/, async (route) => {
    const url = new URL(route.request().url());
    asked.push(url);
    if (url.searchParams.get("from") !== midnight(day(1)) || !url.pathname.includes("pack-01")) return route.continue();
    if (route.request().headers()["accept"] === "text/csv") return route.continue();
    const own = await (await route.fetch({ url: url.href.replace(/from=.*/, `from=${encodeURIComponent(midnight(day(0)))}`) })).json();
    const { from, to } = Object.fromEntries(url.searchParams);
    const states = { ...own.states, running_ms: 900, waiting_ms: 100, alarm_ms: 0, manual_ms: 0, other_ms: 0 };
    const availability = { ...own.availability, value: 0.9 };
    const cycles = { ...own.cycles, count: 7, timed: 7, p50_ms: 2_000, p90_ms: 2_500, min_ms: 1_900, max_ms: 2_600, mean_ms: 2_050 };
    return route.fulfill({ json: { ...own, from, to, seen_ms: 1_000, states, availability, cycles, parts: { ...own.parts, count: 6, resets: 0 } } });
  });
  await page.goto(`${made.url}/production#${await made.token("viewer")}`);
  await page.waitForSelector("[data-figures=done]");
  expect(asked.map((url) => url.searchParams.get("from"))).toEqual(Array(3).fill([midnight(day(0)), midnight(day(1))]).flat());
  await says(page, "thead", new RegExp(`${day(0)}, 00:00 to [^]*${day(1)}, 00:00 to `));
  const cells = async (row: string): Promise<string[]> => page.locator(`${row} td`).allTextContents();
  const [today, yesterday] = await cells("[data-each='pack-01 0']").then(async (first) => [first, await cells("[data-each='pack-01 1']")]);
  expect(Number(today![4]), today!.join("|")).toBeGreaterThan(0);
  expect(yesterday!.slice(2)).toEqual(["90.0 %", "6", "7", "up to 2.00 s", "up to 2.50 s"]);
  // What was not seen, and what is not told, is named and is not 0.
  expect((await cells("[data-each='press-01 1']")).slice(2, 5)).toEqual(Array(3).fill("nothing was seen"));
  expect((await cells("[data-each='old-01 0']"))[3]).toBe("not told");
  await says(page, "[data-figure=parts]", /2 of 3 robots[^]*parts, /);
  await says(page, "[data-figure=availability]", /curMode, curAlarm, unseen/);
  await says(page, "main", `Parts, ${day(0)}`);
  await page.getByRole("button", { name: "Details of pack-01" }).click();
  await says(page, "[data-distribution=pack-01]", /s to \d[^]*[1-9]/);
  await isAccessible(page);
  for (const [theme, width] of [["light", 1920], ["dark", 768]] as const) {
    await page.emulateMedia({ colorScheme: theme });
    await page.setViewportSize({ width, height: 1080 });
    await fits(page);
    await picture(page, `production-${width}-${theme}`, true);
  }
  const csv = await downloaded(page, () => page.click("[data-export=production]"));
  const lines = csv.bytes.toString().trim().split("\r\n");
  expect(csv.name).toBe(`production-${day(0)}.csv`);
  expect(lines[0]).toMatch(/^robot,shift,date,from,to,/);
  expect(lines.slice(1).map((line) => line.split(",")[0])).toEqual(Array(2).fill(["old-01", "pack-01", "press-01"]).flat());
  expect(faults).toEqual([]);
  await page.context().close();
});

test("a shift is beside the same one of the day before, on a phone in Chinese", async () => {
  const { page, faults } = await openPage(browser, { viewport: { width: 390, height: 844 }, locale: "zh-CN", colorScheme: "dark", hasTouch: true });
  await page.goto(`${made.url}/production?robot=pack-01#${await made.token("viewer")}`);
  await page.waitForSelector("[data-figures=done]");
  await page.tap("text=按班次");
  const [, shift, date] = /(early|late)@(\S+)/.exec((await page.locator("label:has-text('本期') select").inputValue()) ?? "") ?? [];
  const [, second] = /^(early|late)@/.exec(await page.locator("label:has-text('对比期') select").inputValue()) ?? [];
  expect(second).toBe(shift);
  await says(page, "[data-figures=done]", "截至");
  await says(page, "[data-figure=availability]", /%[^]*没有看到任何数据/);
  await says(page, "section:has(#together)", "其中一个时间段尚未结束，数量不做相减。");
  // A robot that is not there is told, with what to do.
  await page.goto(`${made.url}/history?robot=gone&signal=axis-0`);
  await says(page, "main [role=alert]", "gone 不存在，或您无权查看。");
  await page.goto(`${made.url}/production?robot=gone`);
  await says(page, "[data-problem=no_such_robot]", "no_such_robot");
  await isAccessible(page);
  await page.goto(`${made.url}/production?robot=pack-01&compare=shift`);
  await page.waitForSelector("[data-figures=done]");
  await says(page, "[data-by-shift=done] tbody tr:first-child", new RegExp(`${shift}，${date}，进行中[^]*%`));
  // The figures of the hall, of each robot and of shifts are cards. The cycle times of one may be scrolled.
  expect((await sideways(page)).filter((label) => label !== "循环时间分布")).toEqual([]);
  await fits(page);
  await isAccessible(page);
  await picture(page, "production-390-zh", true);
  expect(faults).toEqual([]);
  await page.context().close();
});
