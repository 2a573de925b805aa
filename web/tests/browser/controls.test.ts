import { writeFileSync } from "node:fs";
import { join } from "node:path";
import type { Browser, Page } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import type { PanelState } from "../../src/api/types.ts";
import { HOLD } from "../../src/ui/hold.ts";
import { Running, fits, folder, hasThisPage, isAccessible, openPage, picture, r6, says, startBrowser, until } from "./support.ts";

const data = folder();
let browser: Browser;
let robots: Running;
let gateway: Running;
let url = "";
let added = "";
let engineer = "";
let admin = "";

beforeAll(async () => {
  const here = "127.0.0.1:0";
  robots = new Running("sim", "--listen", here, "--listen", here);
  const [saw = "", other = ""] = await robots.all(/listening on (\S+)/g, 2);
  added = other;
  const config = join(data.path, "hall.toml");
  writeFileSync(config, `[[robot]]\nname = "saw"\naddress = "${saw}"\nmodel = "BRTIRUS0707A"\nperiod_ms = 50\n`);
  gateway = new Running("gateway", "--listen", here, "--data", join(data.path, "data"), "--config", config, "--twins");
  url = await gateway.said(/gateway on (http:\/\/[^\s,]+)/);
  await hasThisPage(url);
  [engineer, admin] = await Promise.all([token("engineer"), token("admin")]);
  browser = await startBrowser();
});

afterAll(async () => {
  await browser?.close();
  await gateway?.kill();
  await robots?.kill();
  data.remove();
});

async function token(role: string): Promise<string> {
  return (await r6("gateway", "token", "--data", join(data.path, "data"), "--role", role)).trim();
}

/** Asks the gateway in the name of a token. */
async function ask(method: string, path: string, by: string, body?: object): Promise<Response> {
  const headers = { Authorization: `Bearer ${by}`, "Content-Type": "application/json" };
  return fetch(url + path, { method, headers, ...(body === undefined ? {} : { body: JSON.stringify(body) }) });
}

/**
 * Presses a button for as long as it has to be held, and waits for what comes of it. A press ends by itself where the
 * page hears nothing of the robot meanwhile, as on a busy machine: then it was too short, and it is pressed again.
 */
async function hold(page: Page, text: string, brings: string): Promise<void> {
  const button = page.getByRole("button", { name: text, exact: true });
  for (let heldFor = 0; heldFor < HOLD; ) {
    await until(`"${text}" can be pressed`, () => button.isEnabled());
    await button.hover();
    const begun = Date.now();
    await page.mouse.down();
    await until(`"${text}" was held`, async () => (await button.and(page.locator(".held")).count()) === 0);
    heldFor = Date.now() - begun;
    await page.mouse.up();
  }
  await page.waitForSelector(brings);
}

/** Stores another version of a program. */
async function again(name: string, program: string): Promise<void> {
  const path = `/v1/programs/${name}`;
  const { etag } = (await (await ask("GET", path, engineer)).json()) as { etag: string };
  const headers = { Authorization: `Bearer ${engineer}`, "Content-Type": "application/json", "If-Match": etag };
  const stored = await fetch(url + path, { method: "PUT", headers, body: JSON.stringify({ program }) });
  expect(stored.status).toBe(200);
}

/** Removes a program, and stores one of its name: its versions begin at 1 again. */
async function anew(name: string, program: string): Promise<void> {
  const path = `/v1/programs/${name}`;
  const { etag } = (await (await ask("GET", path, engineer)).json()) as { etag: string };
  const headers = { Authorization: `Bearer ${engineer}`, "If-Match": etag };
  expect((await fetch(url + path, { method: "DELETE", headers })).status).toBe(204);
  expect((await ask("PUT", path, engineer, { program })).status).toBe(201);
}

async function control(page: Page, robot: string): Promise<void> {
  await page.goto(`${url}/robots/${robot}`);
  await page.locator("[data-lease=free] button").click();
  await page.waitForSelector("[data-lease=mine]");
}

test("speed, outputs, counters and registers are set under the lease, and a stop names who stopped", async () => {
  const { page, faults } = await openPage(browser);
  await page.goto(`${url}/#${engineer}`);
  await page.waitForSelector("[data-robot=saw]");
  await control(page, "saw");
  // The page asks before a first speed and before a faster one, and not before a slower one.
  await says(page, "[data-speed]", "Not known: the controller does not report it");
  await page.fill("[data-percent]", "30");
  await page.click("[data-control=speed]");
  await says(page, "[role=dialog]", "What the speed is now is not known");
  await page.click("[data-raise]");
  await says(page, "[data-speed]", /30 %, set by token \d+, \d\d:\d\d:\d\d; not reported by the controller/);
  await page.fill("[data-percent]", "20");
  await page.keyboard.press("Enter");
  await says(page, "[data-speed]", "20 %");
  await page.fill("[data-percent]", "60.5");
  await page.keyboard.press("Enter");
  await says(page, "[role=dialog]", "It was 20 %");
  await page.keyboard.press("Escape");
  await says(page, "[data-speed]", "20 %");
  expect(await page.isDisabled("[data-control=speed]")).toBe(false);
  // The question closes when control ends.
  await page.click("[data-control=speed]");
  await says(page, "[role=dialog]", "It was 20 %");
  await page.evaluate(() => document.querySelector<HTMLElement>("[data-lease=mine] button")?.click());
  await page.waitForSelector("[role=dialog]", { state: "detached" });
  await says(page, "[data-told-command=control]", "The speed was not set: take control first. Give it again.");
  await page.locator("[data-lease=free] button").click();
  await page.waitForSelector("[data-lease=mine]");

  await page.selectOption("[data-output]", { label: "Y012" });
  await page.click("[data-set-output=on]");
  await says(page, "[data-told-command=io]", "Y012 on: the controller accepted it.");
  await page.waitForSelector('[data-point="output 3"].on');
  await page.click("[data-set-output=off]");
  await page.waitForSelector('[data-point="output 3"]:not(.on)');
  await page.fill("[data-new=counter]", "12");
  await page.click("[data-set=counter]");
  await says(page, "[data-number=counter]", /^12, target 0, read \d\d:/);
  await page.fill("[data-new=register]", "-42");
  await page.click("[data-set=register]");
  await says(page, "[data-number=register]", /^-42, read/);
  await says(page, "[data-limits=axis-1]", "-105 to 75");
  await says(page, "[data-torque='1']", /^-?\d+\.\d$/);
  expect(await page.locator("[data-panel]").count(), "a robot that is no twin has no panel here").toBe(0);
  await isAccessible(page);

  await page.click("[data-stop=saw]");
  await says(page, "[data-doing]", "It waits for you to clear the stop.");
  await says(page, "[data-stopped-by]", /^Stopped by token \d+, \d\d:\d\d:\d\d$/);
  expect(await page.getAttribute("[data-stopped-by]", "href")).toBe("/audit?robot=saw&kind=stop");
  expect(await page.isDisabled("[data-set-output=on]")).toBe(true);
  await says(page, "[data-told]", "saw: stopped, seen");
  await page.click("[data-control=clear_stop]");
  await says(page, "[data-told-command=control]", "Clear stop: done.");
  await until("what became of the stop goes", async () => (await page.textContent("[data-told]"))?.trim() === "");
  await page.waitForSelector("[data-stopped-by]", { state: "detached" });

  // Who comes later sees who set the speed. The twin is a link away.
  await page.reload();
  await says(page, "[data-speed]", /20 %, set by token \d+/);
  await page.click("[aria-labelledby=facts] a[href='/robots/saw-twin']");
  await says(page, "h1", "saw-twin");
  expect(faults).toEqual([]);
  await page.context().close();
});

test("the panel of a twin: key, moves by hand, inputs, emergency stop, in Chinese", async () => {
  const { page, faults } = await openPage(browser, { viewport: { width: 390, height: 844 }, locale: "zh-CN" });
  await page.goto(`${url}/#${engineer}`);
  await page.waitForSelector("[data-robot=saw-twin]");
  await control(page, "saw-twin");
  await says(page, "[data-panel-state]", "运行中，全局速度 100 %");
  await says(page, "[data-speed]", "100 %（来自此虚拟机器人的面板）");
  expect(await page.isDisabled("[data-panel='jog-J1+']")).toBe(true);
  await page.click("[data-panel=key-manual]");
  await says(page, "[data-panel-state='1']", "手动");
  await page.click("[data-panel='jog-J1+']");
  await says(page, "[data-told-command=panel]", "J1 +10：面板已接受。");
  await page.click("[data-tab=axes]");
  await says(page, "[data-value=axis-0]", /^10\.000$/);
  await fits(page);
  await page.click("[data-tab=live]");
  await page.click("[data-panel=input-on]");
  await says(page, "[data-inputs-on]", "接通：X010");
  await page.click("[data-panel=input-off]");
  await page.click("[data-panel=estop]");
  await says(page, "[data-panel-state]", "急停已按下");
  await says(page, "[data-alarm='7']", "7");
  await fits(page);
  await isAccessible(page);
  await picture(page, "robot-panel-390-light");
  await page.click("[data-panel=release]");
  await page.click("[data-panel=clear]");
  await page.click("[data-control=clear_stop]");
  await says(page, "[data-told-command=control]", "解除停止：完成。");
  await page.click("[data-panel=key-auto]");
  await page.waitForSelector("[data-panel-state='2']");
  await hold(page, "按住：启动", "[data-panel-state='7']");
  await page.locator("[data-lease=mine] button").click();
  await page.waitForSelector("[data-lease=free]");
  expect(faults).toEqual([]);
  await page.context().close();
});

test("an axis of a twin moves as long as its button is held, and its faults begin and end", async () => {
  const { page, faults } = await openPage(browser);
  await page.goto(`${url}/#${engineer}`);
  await page.waitForSelector("[data-robot=saw-twin]");
  await control(page, "saw-twin");
  await page.click("[data-panel=key-manual]");
  await says(page, "[data-panel-state='1']", "manual");
  const j1 = async (): Promise<{ moving: boolean; at: number }> => {
    const seen = (await (await ask("GET", "/v1/robots/saw-twin/panel", engineer)).json()) as PanelState;
    return { moving: seen.moving, at: seen.axes[0]?.position ?? 0 };
  };
  const button = page.locator("[data-jog='J1-']");
  for (const letGo of [
    () => page.mouse.up(),
    // The page loses the focus while the button of the mouse is still down.
    () => page.evaluate(() => void window.dispatchEvent(new Event("blur"))),
  ]) {
    // More than 200 ms move it so far in one go at 10 % of its speed. Where a word of the page comes late, because the
    // machine does other things too, the axis stands, and the button is pressed again.
    await until("the axis moves on", async () => {
      await until("the axis stands", async () => !(await j1()).moving);
      const from = await j1();
      // What is read later moves the button.
      await button.hover();
      await page.mouse.down();
      const end = Date.now() + 3_000;
      await until("it has moved on, or stands", async () => {
        const now = await j1();
        return now.at < from.at - 8 || (!now.moving && (now.at < from.at || Date.now() > end));
      });
      if ((await j1()).at < from.at - 8) return true;
      await page.mouse.up();
      return false;
    });
    await letGo();
    await until("the axis stands", async () => !(await j1()).moving);
    const rests = await j1();
    await page.mouse.up();
    expect((await j1()).at).toBe(rests.at);
  }
  await page.click("[data-panel=key-auto]");

  await page.waitForSelector("[data-faults='0']");
  await page.selectOption("[data-fault]", "bad-json");
  await page.selectOption("[data-fault-kind]", "nul");
  await page.selectOption("[data-fault]", "task-dead");
  expect(await page.locator("[data-fault-kind]").count()).toBe(0);
  await page.click("[data-begin-fault]");
  await says(page, "[data-told-command=panel]", "Begin: Only heartbeats are answered: the panel took it.");
  await says(page, "[data-faults='1']", "Only heartbeats are answered, ends in");
  await isAccessible(page);
  await picture(page, "robot-faults-light");
  // Its panel answers, and the robot does not: the gateway would refuse what needs an answer of it.
  const start = page.getByRole("button", { name: "Hold: Start", exact: true });
  await says(page, "[data-waits]", "the gateway waits for an answer of the robot: try again in a moment");
  expect(await start.isDisabled()).toBe(true);
  expect(await page.isDisabled("[data-panel=estop]")).toBe(false);
  await page.click("[data-end-faults]");
  await page.waitForSelector("[data-faults='0']");
  // Start is offered again by itself, and the gateway takes it then: it has read the robot.
  await hold(page, "Hold: Start", "[data-panel-state='7']");
  await page.locator("[data-lease=mine] button").click();
  await page.waitForSelector("[data-lease=free]");
  expect(faults).toEqual([]);
  await page.context().close();
});

const SWEEP = `[[instruction]]\ndo = "axis-move"\nto = [30, 0, 0, 0, 0, 0]\nspeed = 40\n`;

test("a kept program is checked, planned, run by holding, and its end is proved", async () => {
  expect((await ask("PUT", "/v1/programs/sweep", engineer, { program: SWEEP })).status).toBe(201);
  await ask("PUT", "/v1/programs/broken", engineer, { program: SWEEP.replace("axis-move", "axis-moove") });
  const { page, faults } = await openPage(browser);
  await page.goto(`${url}/#${engineer}`);
  await page.waitForSelector("[data-robot=saw-twin]");
  await control(page, "saw-twin");
  await page.selectOption("[data-program]", "sweep");
  expect(await page.locator("[data-program] option", { hasText: "broken" }).isDisabled()).toBe(true);
  await page.click("[data-prepare]");
  await says(page, "[data-prepared]", /sweep, version 1: 1 step, 1 time\./);
  await says(page, "[data-prepared]", /\d+ mm in \d+\.\d\d s at 100 %\./);
  await says(page, "[data-prepared]", "Its panel shows 100 %.");
  // At a twin nothing is at stake but the twin.
  expect(await page.textContent("[data-prepared]")).not.toContain("Stay here");
  await picture(page, "robot-run-1920-light");
  await isAccessible(page);
  // On a slow machine that took longer than a lease lasts.
  await control(page, "saw-twin");
  await page.selectOption("[data-program]", "sweep");
  await page.click("[data-prepare]");
  await page.waitForSelector("[data-prepared]");
  // Another version that is stored meanwhile makes it void.
  await again("sweep", `${SWEEP}# again\n`);
  await says(page, "[data-refused]", "Not run: another version of the program was stored. Prepare it again.");
  expect(await page.locator("[data-prepared]").count()).toBe(0);
  await page.click("[data-prepare]");
  await says(page, "[data-prepared]", "sweep, version 2");
  // Removed and stored anew, another text has the same number. The list of this page is of before.
  const before = await (await ask("GET", "/v1/programs", engineer)).text();
  await page.route("**/v1/programs", (route) => route.fulfill({ contentType: "application/json", body: before }));
  await anew("sweep", SWEEP.replace("[30", "[-30"));
  await again("sweep", SWEEP.replace("[30", "[-40"));
  await hold(page, "Hold to run on saw-twin", "[data-refused]");
  await says(page, "[data-refused]", "Not run: another version of the program was stored. Prepare it again.");
  expect(await page.locator("[data-run]").count(), "nothing was sent").toBe(0);
  await again("sweep", SWEEP);
  await page.unroute("**/v1/programs");
  await page.waitForResponse((response) => response.url().endsWith("/v1/programs"));
  await page.click("[data-prepare]");
  await says(page, "[data-prepared]", "sweep, version 3");
  // So does the end of control.
  await page.locator("[data-lease=mine] button").click();
  await says(page, "[data-refused]", "Not run: the control has ended. Prepare it again.");
  await page.locator("[data-lease=free] button").click();
  await page.waitForSelector("[data-lease=mine]");
  await page.click("[data-prepare]");
  await hold(page, "Hold to run on saw-twin", "[data-run]");
  await says(page, "[data-run=done]", /Done on saw-twin[^]*sweep, run by token \d+[^]*Steps seen to be done: 1 of 1\./);
  await says(page, "[data-proof=reached]", "the arm stands where the last move ends");
  expect(await page.locator("[data-refused]").count(), "a run that succeeded leaves no fault").toBe(0);
  await says(page, "[data-value=axis-0]", /^30\.000$/);

  // A stop ends a run, and the page says why it ended.
  await ask("PUT", "/v1/programs/back", engineer, { program: SWEEP.replace("[30", "[-120").replace("40", "1") });
  await page.focus("[data-program]");
  await until("the new program is listed", async () => (await page.locator("[data-program] option[value=back]").count()) === 1);
  await page.selectOption("[data-program]", "back");
  await page.click("[data-prepare]");
  await page.waitForSelector("[data-prepared]");
  await hold(page, "Hold to run on saw-twin", "[data-run=running]");
  // A second page of another person tells of it too.
  const other = await openPage(browser);
  await other.page.goto(`${url}/#${admin}`);
  await other.page.waitForSelector("[data-robot=saw-twin]");
  await other.page.goto(`${url}/robots/saw-twin`);
  await says(other.page, "[data-run=running]", /back, run by token \d+/);
  await page.keyboard.press("F9");
  await says(page, "[data-run=stopped]", /Stopped before its end by token \d+/);
  await says(other.page, "[data-run=stopped]", /Stopped before its end by token \d+/);
  await other.page.context().close();
  await page.click("[data-control=clear_stop]");
  expect(faults).toEqual([]);
  await page.context().close();
});

test("an admin takes a lease over with a reason, and chooses a model; another robot is accepted", async () => {
  const holder = await openPage(browser);
  await holder.page.goto(`${url}/#${engineer}`);
  await holder.page.waitForSelector("[data-robot=saw]");
  await control(holder.page, "saw");
  const { page, faults } = await openPage(browser, { viewport: { width: 768, height: 1024 }, colorScheme: "dark" });
  await page.goto(`${url}/#${admin}`);
  await page.waitForSelector("[data-robot=saw]");
  await page.goto(`${url}/robots/saw`);
  await page.click("[data-take]");
  await says(page, "[role=dialog]", /Take saw from token \d+\?[^]*stops the robot first/);
  expect(await page.isDisabled("[data-take-over]")).toBe(true);
  await page.fill("[data-reason]", "the operator has left");
  await isAccessible(page);
  // Another one gets it while the question is open: nothing is taken from somebody who was not asked about.
  await holder.page.locator("[data-lease=mine] button").click();
  await says(page, "[data-take-changed=true]", "it is free");
  expect(await page.isDisabled("[data-take-over]")).toBe(true);
  await control(holder.page, "saw");
  await page.waitForSelector("[data-take-changed=false]", { state: "attached" });
  await page.click("[data-take-over]");
  await page.waitForSelector("[data-lease=mine]");
  await says(page, "[data-doing]", "It waits for you to clear the stop.");
  await says(holder.page, "[data-lease=others]", "Your control has ended.");
  await holder.page.context().close();
  await page.click("[data-control=clear_stop]");
  await says(page, "[data-told-command=control]", "Clear stop: done.");
  await page.locator("[data-lease=mine] button").click();

  // A robot of the API has no model until an admin chooses it: everything else stays as it is.
  const wanted = { address: added, period_ms: 200, read: ["counter-0", "Addr-800"] };
  expect((await ask("PUT", "/v1/robots/added", admin, wanted)).status).toBe(201);
  await page.goto(`${url}/robots/added`);
  await says(page, "main", "there are numbers only");
  await page.selectOption("[data-model]", "BRTIRUS0707A");
  await page.click("text=Set the model of added");
  await page.waitForSelector("[data-scene]");
  const state = (await (await ask("GET", "/v1/robots/added", admin)).json()) as { period_ms: number; signals: { address: string }[] };
  expect(state.period_ms).toBe(200);
  expect(state.signals.map(({ address }) => address).slice(-2)).toEqual(["counter-0", "Addr-800"]);
  await fits(page);
  expect(faults).toEqual([]);
  await page.context().close();
});

test("an exchanged robot is shown beside the one before, and an engineer accepts it", async () => {
  const first = new Running("sim", "--listen", "127.0.0.1:0");
  const address = await first.said(/listening on (\S+)/);
  expect((await ask("PUT", "/v1/robots/swapped", admin, { address, period_ms: 50 })).status).toBe(201);
  const { page, faults } = await openPage(browser);
  await page.goto(`${url}/#${engineer}`);
  await page.click("[data-robot=swapped]");
  await says(page, "[data-doing]", "The program runs.");
  await first.kill();
  let second = new Running("sim", "--listen", address, "--model", "GENERIC-SCARA");
  try {
    await says(page, "[data-changed=swapped]", /r6 virtual BRTIRUS0707A[^]*r6 virtual GENERIC-SCARA/);
    await isAccessible(page);
    // Two steps, for the robot that is shown: when the first one answers again, nothing is accepted.
    await page.click("[data-accept]");
    await says(page, "[role=dialog]", /GENERIC-SCARA/);
    await second.kill();
    second = new Running("sim", "--listen", address, "--model", "BRTIRUS1510A");
    await page.waitForSelector("[role=dialog]", { state: "detached" });
    await says(page, "[data-not-accepted]", "Nothing was accepted: what was shown is not what answers now");
    await says(page, "[data-changed=swapped]", "BRTIRUS1510A");
    await page.click("[data-accept]");
    await says(page, "[role=dialog]", /BRTIRUS1510A/);
    const [request] = await Promise.all([page.waitForRequest("**/accept-identity"), page.click("[data-accept-now]")]);
    expect(request.postDataJSON()).toMatchObject({ machine_name: "r6 virtual BRTIRUS1510A" });
    await says(page, "[data-act=done]", "Accept the robot that answers as swapped: Done.");
    await says(page, "[data-doing]", "The program runs.");
    expect(faults).toEqual([]);
  } finally {
    await second.kill();
  }
  await page.context().close();
});
