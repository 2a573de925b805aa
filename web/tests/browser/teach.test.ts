import { writeFileSync } from "node:fs";
import { join } from "node:path";
import type { Browser, Page } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import {
  Running,
  SOFTWARE_3D,
  fits,
  folder,
  hasThisPage,
  isAccessible,
  openPage,
  picture,
  r6,
  says,
  startBrowser,
  until,
} from "./support.ts";

/** Without a graphics card a large screen takes its time. */
const SMALL = { viewport: { width: 1280, height: 800 } };

const data = folder();
let robot: Running;
let gateway: Running;
let browser: Browser;
let url: string;
/** The address of the twin, as a person at its pendant would have it. */
let twin: string;
let engineer: string;
let operator: string;
let tokenFile: string;

beforeAll(async () => {
  robot = new Running("sim", "--listen", "127.0.0.1:0");
  const address = await robot.said(/listening on (\S+)/);
  const hall = join(data.path, "hall.toml");
  writeFileSync(hall, `[[robot]]\nname = "press-4"\naddress = "${address}"\nmodel = "BRTIRUS0707A"\n`);
  const kept = join(data.path, "gateway");
  gateway = new Running("gateway", "--listen", "127.0.0.1:0", "--data", kept, "--config", hall, "--twins");
  url = await gateway.said(/gateway on (http:\/\/[^\s,]+)/);
  twin = await gateway.said(/press-4-twin on ([^\s,]+)/);
  await hasThisPage(url);
  engineer = (await r6("gateway", "token", "--data", kept, "--role", "engineer", "--name", "ann")).trim();
  operator = (await r6("gateway", "token", "--data", kept, "--role", "operator")).trim();
  // The picture has a test of its own: drawing it without a graphics card takes a core.
  tokenFile = join(data.path, "token");
  writeFileSync(tokenFile, operator, { mode: 0o600 });
  browser = await startBrowser("--disable-3d-apis");
});

afterAll(async () => {
  await browser?.close();
  await gateway?.kill();
  await robot?.kill();
  data.remove();
});

async function signIn(page: Page, token: string, path: string): Promise<void> {
  await page.goto(`${url}/#${token}`);
  await page.waitForSelector('[data-robot="press-4"]');
  await page.goto(url + path);
}

/** Moves the twin as a person at its pendant would, and takes a point there. */
async function take(page: Page, ...axes: number[]): Promise<void> {
  await r6("-r", twin, "move", "axes", ...axes.map(String), "--speed", "100", "--wait");
  const before = Number(await page.getAttribute("[data-points]", "data-points"));
  await until("a point is taken", async () => {
    await page.click("[data-take-point]");
    await page.waitForFunction(() => !document.querySelector("[data-take-point]")?.hasAttribute("disabled"));
    return Number(await page.getAttribute("[data-points]", "data-points")) > before;
  });
}

async function add(page: Page, kind: string, point?: string): Promise<void> {
  await page.selectOption("[data-kind]", kind);
  if (point !== undefined) await page.selectOption("[data-to]", point);
  await page.click("[data-add]");
}

async function set(page: Page, field: string, text: string): Promise<void> {
  await page.fill(`[data-field=${field}]`, text);
  await page.press(`[data-field=${field}]`, "Tab");
}

/** Prepares, and presses the button that has to be held. */
async function hold(page: Page, name: string): Promise<void> {
  await page.click("[data-prepare]");
  await press(page, name);
}

async function press(page: Page, name: string): Promise<void> {
  await says(page, "[role=dialog]", `Run on ${name}?`);
  const button = (await page.locator(`text=Hold to run on ${name}`).boundingBox())!;
  await page.mouse.move(button.x + 5, button.y + 5);
  await page.mouse.down();
}

async function run(page: Page, name: string): Promise<void> {
  await hold(page, name);
  await letGo(page);
}

async function letGo(page: Page): Promise<void> {
  await page.waitForSelector('[data-sent="accepted"], [data-sent="done"]');
  await page.mouse.up();
}

test("three points, an output and a wait run on the twin and then on the arm; what is beyond a limit does not", async () => {
  const { page, faults } = await openPage(browser, SMALL);
  await signIn(page, engineer, "/robots/press-4/teach");
  await says(page, "main", "No program is stored yet.");
  await page.fill("#new-program", "pick");
  await page.click("form button[type=submit]");
  await page.waitForSelector("[data-take-point]");
  expect(page.url()).toBe(`${url}/robots/press-4/teach/pick`);

  await take(page, 0, 10, -20, 0, -80, 0);
  await take(page, 30, 10, -20, 0, -80, 0);
  await take(page, 30, 20, -30, 0, -80, 0);
  await says(page, '[data-point-name="P2"]', "30, 10, -20, 0, -80, 0");
  await says(page, "[data-check='']", "Checked after each change");
  // Points are offered in the order in which they were taken, and the button stays where it is.
  const place = (): Promise<number> => page.locator("[data-add]").evaluate((node) => node.getBoundingClientRect().top + scrollY);
  const before = await place();
  for (const point of ["P1", "P2", "P3"]) {
    expect(await page.inputValue("[data-to]")).toBe(point);
    await add(page, "axis-move");
    await says(page, "[data-step] .row[aria-current=true]", `Axis move ${point}`);
    expect(await place()).toBe(before);
    await set(page, "speed", "60");
  }
  expect(await page.evaluate(() => document.activeElement?.closest("[data-fields]") !== null), "the focus goes on").toBe(true);
  await add(page, "output");
  await add(page, "wait");
  await set(page, "seconds", "0.3");
  await says(page, '[data-step="5"]', "Wait 0.3 s");
  await page.waitForSelector("[data-check=true]");
  await page.waitForSelector('[data-step="5"] [data-runs=sent]');

  // A mistake stands beside its step and field.
  await set(page, "seconds", "0.33");
  await says(page, '[data-step="5"]', /line \d+, column \d+: .*steps of 0.1 seconds/);
  expect(await page.getAttribute('[data-field="seconds"]', "aria-invalid")).toBe("true");
  await page.locator("[data-step='5'] .row").focus();
  await page.keyboard.press("Control+z");
  await page.waitForSelector("[data-check=true]");
  expect(await page.inputValue("[data-field=seconds]")).toBe("0.3");

  // The keys: copy, move, undo both.
  await page.keyboard.press("Control+d");
  await page.keyboard.press("Alt+ArrowUp");
  await page.keyboard.press("ArrowUp");
  expect(await page.getAttribute("[data-steps]", "data-steps")).toBe("6");
  await page.keyboard.press("Control+z");
  await page.keyboard.press("Control+z");
  expect(await page.getAttribute("[data-steps]", "data-steps")).toBe("5");
  await page.waitForSelector("[data-check=true]");

  // The panel of the twin tells what a person at its pendant has set: no event of the gateway does.
  await r6("-r", twin, "command", "modifyGSPD", "80");
  await says(page, "#speed-known", "Its panel shows 80 %.");
  expect(await page.inputValue("[data-speed]")).toBe("80");
  await page.click("[data-make]");
  await page.waitForSelector("[data-preview=done]");
  expect(Number(await page.getAttribute("[data-duration]", "data-duration"))).toBeGreaterThan(500);
  await page.click("[data-pace='4']");
  const begin = await page.textContent('[data-planned-axis="0"]');
  await page.locator("[data-step='5'] .row").focus();
  await page.keyboard.press(" ");
  await until("the preview plays to its end", async () => (await page.textContent('[data-planned-axis="0"]')) !== begin);
  await page.waitForSelector("[data-play=false]");

  // A speed that was set makes the preview void, and the next one is for it.
  await r6("-g", url, "--token-file", tokenFile, "-r", "press-4-twin", "command", "modifyGSPD", "90");
  await page.waitForSelector("[data-void=speed]");
  await until("the speed that was set", async () => (await page.inputValue("[data-speed]")) === "90");
  await page.click("[data-make]");
  await page.waitForSelector("[data-preview=done]");

  // A point beyond a limit: the step and the path are red, and nothing is sent.
  await page.click('[data-point-name="P3"] button');
  await page.fill('[data-axis="1"]', "170");
  await page.press('[data-axis="1"]', "Tab");
  await page.waitForSelector('[data-step="3"][data-mark=beyond]');
  await page.waitForSelector("[data-worst=beyond]");
  await says(page, "[data-plan-problem=limit]", "Step 3");
  await page.click("text=Take control");
  await page.waitForSelector("[data-lease=mine]");
  await until("the reason is told", async () => (await page.getAttribute("[data-reasons]", "data-reasons"))?.includes("plan_fails") === true);
  expect(await page.isDisabled("[data-prepare]")).toBe(true);
  await isAccessible(page);
  await page.setViewportSize({ width: 1920, height: 1080 });
  await picture(page, "teach-1920");
  await page.setViewportSize(SMALL.viewport);
  await page.click("text=Undo");
  await page.waitForSelector("[data-preview=done]");
  await page.waitForSelector('[data-step="3"][data-mark=ok]');

  // A second person sees who controls it, and cannot run anything.
  const other = await openPage(browser, SMALL);
  await signIn(other.page, operator, "/robots/press-4/teach/pick");
  await other.page.waitForSelector("[data-lease=others]");
  await says(other.page, "[data-lease]", /1 \(ann\) controls it/);
  expect(await other.page.isDisabled("[data-prepare]")).toBe(true);
  expect(other.faults).toEqual([]);
  await other.page.context().close();

  // On the twin first. The page controls it: both stops are in the bar, and F9 is for both.
  for (const robot of ["press-4-twin", "press-4"]) await page.waitForSelector(`header [data-stop=${robot}] kbd`);
  await page.waitForSelector("[data-prepare]:not([disabled])");
  await run(page, "press-4-twin");
  await says(page, "[data-sent=done]", "Done on press-4-twin, seen");
  await until("the end is in view", () =>
    page.locator("[data-sent=done]").evaluate((node) => {
      const { top, bottom } = node.getBoundingClientRect();
      return top >= 0 && bottom <= innerHeight;
    }),
  );
  // The arm stands elsewhere now, and that is no fault.
  await page.waitForSelector("[data-preview=taken] [data-taken]");
  expect(await page.locator("[data-void]").count()).toBe(0);
  await says(page, "[data-run=done]", "pick, run by");

  // Then on the arm, from where it stands: one press takes control, makes the preview and prepares. Nothing runs
  // before the button was held there too.
  const ran: string[] = [];
  page.on("request", (request) => {
    if (request.url().endsWith("/programs/run")) ran.push(new URL(request.url()).pathname);
  });
  await page.click("[data-run-next=press-4]");
  await says(page, "[role=dialog]", "Run on press-4?");
  await says(page, "[role=dialog]", "Stay here");
  await says(page, "[data-program-runs]", "does not wait for instructions");
  await page.waitForSelector("[data-choose=press-4][aria-pressed=true]");
  await page.waitForSelector("[data-target=press-4] [data-lease=mine]");
  expect(await page.getAttribute("[data-preview]", "data-preview")).toBe("done");
  await page.waitForTimeout(500);
  expect(ran).toEqual([]);
  await press(page, "press-4");
  await letGo(page);
  expect(ran).toEqual(["/v1/robots/press-4/programs/run"]);
  await says(page, "[data-sent=done]", "Done on press-4, seen: the arm stands where the last move ends");
  expect(await r6("-r", await robotAddress(), "status")).toMatch(/30\.0/);

  // Saved, and saved by another one meanwhile.
  await page.click("[data-save]");
  await page.waitForSelector("[data-saved=saved]");
  const path = `${url}/v1/programs/pick`;
  const headers = { Authorization: `Bearer ${engineer}`, "Content-Type": "application/json" };
  const first = (await (await fetch(path, { headers })).json()) as { program: string; etag: string };
  expect(first.program).toContain('# point "P3" = axes [30, 20, -30, 0, -80, 0] pose [');
  expect(first.program).toContain('to = [30, 20, -30, 0, -80, 0] # point "P3"');
  // What was saved is what `r6 run` takes.
  const file = join(data.path, "pick.toml");
  writeFileSync(file, first.program);
  expect(await r6("run", file, "--dry-run")).toContain('"m0":"30.000"');
  const body = JSON.stringify({ program: `# by another one\n${first.program}` });
  await fetch(path, { method: "PUT", headers: { ...headers, "If-Match": first.etag }, body });
  await add(page, "output");
  await page.click("[data-save]");
  await page.waitForSelector("[data-conflict='2']");
  await page.click("text=Compare and choose");
  await says(page, "[data-diff=removed]", "# by another one");
  await isAccessible(page);
  await picture(page, "teach-compare");
  await page.click("text=Go on with what is here");
  await page.click("[data-save]");
  await page.waitForSelector("[data-version='3']");
  expect(faults).toEqual([]);
  await page.context().close();
});

async function robotAddress(): Promise<string> {
  return robot.said(/listening on (\S+)/);
}

test("a point and a move to it are one press and one entry, and a number of it is changed in one more", async () => {
  const { page, faults } = await openPage(browser, SMALL);
  await signIn(page, operator, "/robots/press-4/teach/quick");
  for (const n of [1, 2, 3]) {
    await page.waitForSelector("[data-take-move]:not([disabled])");
    await page.click("[data-take-move]");
    await says(page, `[data-step="${n}"] .row[aria-current=true]`, `Axis move P${n}, 20 %`);
  }
  await page.waitForSelector("[data-check=true]");
  // The numbers of the point of the chosen step are there.
  await setJ1(page, "-25");
  await says(page, '[data-point-name="P3"]', /-25, /);
  await page.click('[data-point-name="P2"] button');
  await setJ1(page, "25");
  await says(page, '[data-point-name="P2"]', /25, /);
  // A text that is no number is said, also after another field was filled, and nothing runs with the number before.
  await setJ1(page, "0-20");
  await page.fill('[data-axis="2"]', "11");
  await page.press('[data-axis="2"]', "Enter");
  await says(page, "[role=group] [role=alert]", "J1: This is no number.");
  expect(await page.isDisabled("[data-prepare]")).toBe(true);
  await page.waitForSelector("[data-reasons~=unread_field]");
  await page.click("text=Undo");
  await page.waitForSelector("[data-prepare]:not([disabled])");
  expect(await page.inputValue('[data-axis="1"]')).toBe("25");
  await page.click("text=Undo");
  await page.click("text=Undo");
  await page.click("text=Undo");
  expect(await page.locator("[data-steps='2'], [data-points='2']").count(), "step and point went together").toBe(2);
  await page.waitForSelector('[data-step="2"] .row[aria-current=true]');
  // One press prepares, with control and a preview. Nothing is sent without the hold.
  const sent: string[] = [];
  page.on("request", (request) => {
    if (request.url().endsWith("/programs/run")) sent.push(request.url());
  });
  await page.click("text=Take control and prepare run on press-4-twin");
  await says(page, "[role=dialog]", "Run on press-4-twin?");
  await page.waitForSelector("[data-lease=mine]");
  await page.click("[role=dialog] >> text=Cancel");
  expect([sent, await page.locator("[data-run-next]").count()]).toEqual([[], 0]);
  await isAccessible(page);
  expect(faults).toEqual([]);
  await page.context().close();
});

async function setJ1(page: Page, text: string): Promise<void> {
  await page.fill('[data-axis="1"]', text);
  await page.press('[data-axis="1"]', "Enter");
}

test("on a phone in Chinese points are taken and the preview is seen; steps are read only", async () => {
  const { page, faults } = await openPage(browser, { viewport: { width: 390, height: 844 }, locale: "zh-CN", hasTouch: true });
  await signIn(page, operator, "/robots/press-4/teach/pick");
  await page.waitForSelector('[data-step="6"]');
  expect(await page.locator("[data-add], [data-prepare], [data-fields]").count()).toBe(0);
  await says(page, "[data-steps]", "窄屏上只显示步骤");
  await page.tap("[data-take-point]");
  await page.waitForSelector('[data-point-name="P4"]');
  await page.waitForSelector("[data-make]:not([disabled])");
  await page.tap("[data-make]");
  await page.waitForSelector("[data-preview=done]");
  await fits(page);
  await isAccessible(page);
  await picture(page, "teach-390", true);
  // A draft of this browser survives the page.
  await page.reload();
  await page.waitForSelector("[data-draft]");
  await page.waitForSelector('[data-point-name="P4"]');
  await page.setViewportSize({ width: 768, height: 1024 });
  await fits(page);
  await isAccessible(page);
  await page.emulateMedia({ colorScheme: "dark" });
  await picture(page, "teach-768-dark", true);
  expect(faults).toEqual([]);
  await page.context().close();
});

test("a program with a long name is no wider than the screen", async () => {
  const { page, faults } = await openPage(browser, { viewport: { width: 390, height: 844 } });
  const name = "p".repeat(900);
  await signIn(page, engineer, `/robots/press-4/teach/${name}`);
  await page.waitForSelector("[data-version]");
  await fits(page);
  await page.click("[data-take-point]");
  await page.waitForSelector('[data-program-state="unstored"] strong');
  await page.goto(`${url}/robots/press-4/teach`);
  await page.waitForSelector("#new-program");
  await page.waitForSelector(`a[href$="${name}"]`);
  await fits(page);
  // A draft of another page of this browser is listed as soon as that page keeps it.
  const other = await page.context().newPage();
  await other.goto(`${url}/robots/press-4/teach`);
  const draft = JSON.stringify({ text: "", base: null, at: Date.now() });
  await other.evaluate((text) => localStorage.setItem("r6-draft-elsewhere", text), draft);
  await page.waitForSelector('a[href$="/elsewhere"]');
  expect(faults).toEqual([]);
  await page.context().close();
});

test("a text that the page does not take apart is kept, with the place", async () => {
  const headers = { Authorization: `Bearer ${engineer}`, "Content-Type": "application/json", "If-None-Match": "*" };
  const program = '[[instruction]]\ndo = "wait"\nseconds = """1"""\n';
  await fetch(`${url}/v1/programs/odd`, { method: "PUT", headers, body: JSON.stringify({ program }) });
  const { page, faults } = await openPage(browser, SMALL);
  await signIn(page, operator, "/robots/press-4/teach/odd");
  await says(page, "[data-raw=long_text]", "Line 3, column 11");
  expect(await page.inputValue("textarea")).toBe(program);
  await page.fill("textarea", program.replaceAll('"""', ""));
  await page.click("button:text('Take this text')");
  await says(page, '[data-step="1"]', "Wait 1 s");
  await page.waitForSelector("[data-check=true]");
  expect(await page.isDisabled("[data-save]"), "an operator stores nothing").toBe(true);

  // A request without an answer is told as that, and is not sent again.
  let requests = 0;
  await page.route("**/programs/run", (route) => {
    requests += 1;
    return route.abort();
  });
  await page.click("text=Take control");
  await page.click("[data-make]");
  await page.waitForSelector("[data-prepare]:not([disabled])");
  await hold(page, "press-4-twin");
  await says(page, "[data-sent=unknown]", "OUTCOME UNKNOWN");
  await page.mouse.up();
  await isAccessible(page);
  await page.getByRole("button", { name: "I have looked at the arm" }).waitFor();
  expect([requests, await page.locator("text=Look at press-4-twin").count(), await page.locator("[data-stop=press-4-twin]").count()]).toEqual([
    1, 1, 1,
  ]);
  expect(faults).toEqual([]);
  await page.context().close();
});

test("the picture shows the path, and a second arm that is played along it", async () => {
  const drawing = await startBrowser(SOFTWARE_3D);
  const { page, faults } = await openPage(drawing, { viewport: { width: 1440, height: 900 } });
  await signIn(page, operator, "/robots/press-4");
  await page.click('a[href="/robots/press-4/teach"]');
  await page.click("[data-program=pick] a");
  const canvas = page.locator("[data-scene=shown] canvas");
  await canvas.waitFor();
  const seen = async (): Promise<string> => (await canvas.screenshot()).toString("base64");
  const still = async (): Promise<string> => {
    let before = "";
    await until("the picture is still", async () => {
      const now = await canvas.getAttribute("data-drawn");
      const isStill = now === before;
      before = now ?? "";
      await page.waitForTimeout(200);
      return isStill;
    });
    return seen();
  };
  const first = await still();
  await page.waitForSelector("[data-make]:not([disabled])");
  await page.click("[data-make]");
  await page.waitForSelector("[data-preview=done]");
  const planned = await still();
  expect(planned === first, "the path is there").toBe(false);
  await page.click("[data-step='2'] .row");
  expect(await page.textContent("[data-planned-axis='0']")).toBe("30.000 deg");
  const moved = await still();
  expect(moved === planned, "the second arm stands where the step ends").toBe(false);
  await page.waitForSelector("[data-lease=free]");
  await picture(page, "dashboard-teach");
  // While it runs, the picture, its controls and the run are in view together.
  await page.click("text=Take control and prepare");
  await page.waitForSelector("[role=dialog]");
  await picture(page, "teach-1440-asked");
  await page.keyboard.press("Escape");
  await run(page, "press-4-twin");
  await page.waitForSelector("[data-sent=done]");
  const parts = page.locator("canvas, [data-play], [data-make], [data-prepare], [data-sent=done]");
  const boxes = await Promise.all((await parts.all()).map((part) => part.boundingBox()));
  expect(boxes.map((box) => box!.x > 700 && box!.y >= 0 && box!.y + box!.height <= 900)).toEqual([true, true, true, true, true]);
  await picture(page, "teach-1440-done");
  await page.emulateMedia({ colorScheme: "dark" });
  await picture(page, "teach-1440-dark");
  await isAccessible(page);
  expect(faults).toEqual([]);
  await drawing.close();
});
