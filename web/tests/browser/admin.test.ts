import type { Browser, Page } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { type Hall, looks, startHall } from "./gateway.ts";
import { fits, isAccessible, openPage, picture, says, startBrowser, until } from "./support.ts";

const PASSWORD = "correct horse battery";
let hall: Hall;
let browser: Browser;
let admin = "";

beforeAll(async () => {
  [hall, browser] = await Promise.all([startHall(["press-1", "press-2"]), startBrowser()]);
  admin = await hall.token("admin");
});

afterAll(async () => {
  await browser?.close();
  await hall?.end();
});

async function signIn(page: Page, name: string, password: string): Promise<void> {
  const form = page.locator("form").first();
  await form.getByLabel(/^(Name|用户名)$/).fill(name);
  await form.getByLabel(/^(Password|密码)$/).fill(password);
  await form.getByRole("button").click();
}

test("a one-time link makes the first admin, who signs in and makes a user, whose page ends with the user", async () => {
  const { page, faults } = await openPage(browser);
  await page.goto(`${hall.url}/setup#${hall.secret}`);
  await says(page, "h1", "Make the first admin");
  expect(page.url(), "the secret is not in the address any more").toBe(`${hall.url}/`);
  await isAccessible(page);
  await page.getByLabel("Name").fill("anna");
  await page.getByLabel("New password", { exact: true }).fill("short");
  await page.getByLabel("The new password again").fill("other");
  await page.click("button:has-text('Set the password')");
  await says(page, "form", /At least 12 characters[^]*The two passwords differ/);
  await isAccessible(page);
  await page.getByLabel("New password", { exact: true }).fill(PASSWORD);
  await page.getByLabel("The new password again").fill(PASSWORD);
  await page.click("button:has-text('Set the password')");
  await says(page, "[data-welcome]", "The password of anna is set.");
  expect(await page.locator("form").first().getByLabel("Name").inputValue()).toBe("anna");
  await signIn(page, "anna", PASSWORD);
  await page.waitForSelector("[data-robot=press-1]");

  await page.click("text=Users");
  await says(page, "[data-row=anna]", /anna \(you\)[^]*admin[^]*all robots[^]*can sign in/);
  const add = page.locator("form[aria-label='Add a user']");
  await add.getByLabel("Name").fill("Ben");
  await add.getByRole("button", { name: "Add a user" }).click();
  await says(page, "form[aria-label='Add a user']", "This name is not allowed.");
  await add.getByLabel("Name").fill("ben");
  await add.getByLabel("Role").selectOption("engineer");
  await add.getByLabel("Robots").selectOption("some");
  await add.getByLabel("press-1").check();
  await add.getByLabel("all others").check();
  await add.getByLabel("Role: all others").selectOption("operator");
  await picture(page, "users-roles", true);
  await isAccessible(page);
  // A lower role of the whole takes that of each robot with it.
  await add.getByLabel("Role", { exact: true }).selectOption("viewer");
  await add.getByLabel("Role", { exact: true }).selectOption("engineer");
  await add.getByRole("button", { name: "Add a user" }).click();
  await says(page, "[data-row=ben]", /engineer[^]*press-1, all others \(viewer\)[^]*can sign in/);
  const password = await page.getByLabel("Password of ben").inputValue();
  expect(password).toMatch(/^[a-z2-9]{5}(-[a-z2-9]{5}){3}$/);
  await looks(page, "users");

  // Ben signs in with it, on a phone in Chinese. He sees himself, and may change his own password.
  const ben = await openPage(browser, { locale: "zh-CN", viewport: { width: 390, height: 844 } });
  await ben.page.goto(hall.url);
  await signIn(ben.page, "ben", password);
  await ben.page.waitForSelector("[data-robot=press-1]");
  await ben.page.goto(`${hall.url}/users`);
  await says(ben.page, "[data-no-right=admin]", /管理员[^]*工程师[^]*press-1、其他所有机器人（观察员）/);
  const own = ben.page.locator("form[aria-label='修改密码']");
  await own.getByLabel("当前密码").fill("a wrong password");
  await own.getByLabel("新密码", { exact: true }).fill(PASSWORD);
  await own.getByLabel("再次输入新密码").fill(PASSWORD);
  await own.getByRole("button").click();
  await says(ben.page, "[data-problem=wrong_password]", "密码错误。");
  await own.getByLabel("当前密码").fill(password);
  await own.getByRole("button").click();
  await ben.page.waitForSelector("[data-act=done]");
  await fits(ben.page);
  await isAccessible(ben.page);
  await picture(ben.page, "users-own-zh", true);

  // His page ends at once.
  await page.getByRole("button", { name: "Disable ben" }).click();
  await says(page, "[data-row=ben]", "disabled");
  await says(ben.page, "[role=alert]", "会话已结束");

  // The last admin stays.
  await page.getByRole("button", { name: "Remove… anna" }).click();
  await says(page, "[role=dialog]", "This is you");
  await isAccessible(page);
  await hall.ask(admin, "PUT", "/v1/users/ben", { role: "engineer", disabled: true });
  await page.getByRole("button", { name: "Remove anna" }).click();
  await says(page, "[data-problem=last_admin]", "Make another admin first.");
  expect([...faults, ...ben.faults]).toEqual([]);
  await ben.page.context().close();
  await page.context().close();
});

test("a token is shown once, works, and is revoked", async () => {
  const { page, faults } = await openPage(browser);
  await page.goto(`${hall.url}/tokens#${admin}`);
  await page.getByLabel("What it is for").fill("screen in hall 2");
  await page.click("form[aria-label='Make a token'] button");
  await page.waitForSelector("[data-secret]");
  const token = await page.locator("[data-secret] input").inputValue();
  expect((await hall.ask(token, "GET", "/v1/robots")).status).toBe(200);
  await looks(page, "tokens");
  const row = page.locator("tbody tr", { hasText: "screen in hall 2" });
  await row.getByRole("button").click();
  await page.locator("[role=dialog]").getByRole("button", { name: /^Revoke token/ }).click();
  await until("it is gone from the list", async () => (await row.count()) === 0);
  expect(await page.locator("[data-secret]").count(), "it is not shown any more").toBe(0);
  await until("it is refused", async () => (await hall.ask(token, "GET", "/v1/robots")).status === 401);
  expect(faults).toEqual([]);
  await page.context().close();
});

test("settings of the hall: a change of somebody else is not overwritten, and all times follow the zone", async () => {
  const { page, faults } = await openPage(browser);
  await page.goto(`${hall.url}/settings#${admin}`);
  await page.getByLabel("Time zone", { exact: true }).fill("Asia/Shanghai");
  await page.click("text=Add a shift");
  await page.getByLabel("Name", { exact: true }).fill("early");
  await page.getByLabel("Begin", { exact: true }).fill("6:00");
  await says(page, "[data-shift]", "A time such as 06:00.");
  expect(await page.isDisabled("button:has-text('Save')")).toBe(true);
  await page.getByLabel("Begin", { exact: true }).fill("06:00");
  await looks(page, "settings");
  // What the page is made of, with its licences.
  const licences = await page.evaluate(async () => (await fetch(document.querySelector<HTMLAnchorElement>("[data-licences]")!.href)).text());
  for (const name of ["svelte", "three", "uplot"]) expect(licences).toMatch(new RegExp(`^${name} [0-9.]+$[^]*Permission is hereby granted`, "m"));
  const before = (await (await hall.ask(admin, "GET", "/v1/settings")).json()) as { etag: string };
  const changed = await fetch(`${hall.url}/v1/settings`, {
    method: "PUT",
    headers: { Authorization: `Bearer ${admin}`, "Content-Type": "application/json", "If-Match": before.etag },
    body: JSON.stringify({ time_zone: "Europe/Berlin", shifts: [] }),
  });
  expect(changed.status).toBe(200);
  await page.click("button:has-text('Save')");
  await says(page, "[data-problem=not_this_version]", "Somebody else changed it meanwhile.");
  await page.click("text=Try again");
  await until("the zone of the other one", async () => (await page.getByLabel("Time zone", { exact: true }).inputValue()) === "Europe/Berlin");
  await page.getByLabel("Time zone", { exact: true }).fill("Asia/Shanghai");
  await page.click("button:has-text('Save')");
  const now = async (): Promise<string> => ((await (await hall.ask(admin, "GET", "/v1/settings")).json()) as { time_zone: string }).time_zone;
  await until("it is saved", async () => (await now()) === "Asia/Shanghai");
  await page.click("text=Audit log");
  await says(page, "form", "Time of the hall: Asia/Shanghai");
  expect(faults).toEqual([]);
  await page.context().close();
});

test("each page in Chinese on a phone", async () => {
  const options = { locale: "zh-CN", viewport: { width: 390, height: 844 }, colorScheme: "dark" } as const;
  const { page, faults } = await openPage(browser, options);
  await page.goto(`${hall.url}/#${admin}`);
  await page.waitForSelector("[data-robot=press-1]");
  const pages = [
    ["users", "用户", "添加用户"],
    ["tokens", "令牌", "吊销…"],
    ["settings", "设置", "车间的时区与班次"],
    ["connections", "连接", "其他机器人应答网关，以下没有应答：saw。"],
  ] as const;
  for (const [path, title, text] of pages) {
    await page.goto(`${hall.url}/${path}`);
    await says(page, "h1", title);
    await says(page, "main", text);
    await fits(page);
    await isAccessible(page);
    await picture(page, `${path}-zh`, true);
  }
  expect(faults).toEqual([]);
  await page.context().close();
});
