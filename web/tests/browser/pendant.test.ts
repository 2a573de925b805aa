/** Firmware whose restart needs the pendant too. The person at the pendant is the panel of the virtual controller. */
import { writeFileSync } from "node:fs";
import { join } from "node:path";
import type { Browser } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { en } from "../../src/i18n/en.ts";
import { zh } from "../../src/i18n/zh.ts";
import { Person } from "./person.ts";
import { type Cell, Network, folder, isAccessible, openPage, picture, r6, says, startBrowser, startCell, until } from "./support.ts";

/** It stops into mode 3 with alarm 42: docs/PROTOCOL.md, section 12, the row of `actionStop`, unit B. */
const STOPS = 'base = "hc1"\nname = "stops-at-the-pendant"\naction_stop_alarm = 42\naction_stop_mode = "stop"\n';

/** What the arm does: it swings J1 to and fro. */
const WORK = `[[step]]
do = "axis-move"
to = [20, 0, 0, 0, 30, 0]
speed = 20
[[step]]
do = "axis-move"
to = [0, 0, 0, 0, 30, 0]
speed = 20
`;

/** What the page says if the controller refuses to clear an alarm: why, in English alone, and where it can be cleared. */
const REFUSED: Record<string, RegExp> = {
  "en-GB": /does not know clearAlarm; .* on the pendant\. The panel of this virtual robot is its pendant\.$/,
  "zh-CN": /在此虚拟机器人的面板上清除报警/,
};

/** Each test is a whole day of an operator, in milliseconds. */
const LONG = 120_000;

const data = folder();
let browser: Browser;

beforeAll(async () => {
  writeFileSync(join(data.path, "stops.toml"), STOPS);
  writeFileSync(join(data.path, "work.toml"), WORK);
  browser = await startBrowser();
});

afterAll(async () => {
  await browser?.close();
  data.remove();
});

async function cellOf(profile: string): Promise<Cell> {
  return startCell("--profile", profile, "--program", join(data.path, "work.toml"));
}

/** Waits until the numbers of J1 change. */
async function moves(person: Person): Promise<void> {
  const axis = person.part(new RegExp(person.words.robot.axes)).getByRole("row", { name: /^J1\b/ });
  const before = await axis.textContent();
  await until("J1 moves", async () => (await axis.textContent()) !== before);
}

for (const { words, locale } of [
  { words: en, locale: "en-GB" },
  { words: zh, locale: "zh-CN" },
]) {
  const name = `pendant-${words === en ? "en" : "zh"}`;

  test(`a stop, an alarm and a lost gateway, on firmware that starts again after its key was turned, in ${words.name}`, async () => {
    const cell = await cellOf(join(data.path, "stops.toml"));
    const { hostname, port, hash } = new URL(cell.link);
    const network = new Network({ host: hostname, port: Number(port) });
    const { page, faults } = await openPage(browser, { locale });
    try {
      await page.goto(`${await network.open()}/${hash}`);
      const person = new Person(page, words);
      await person.follow(/^virtual /);
      await moves(person);
      await person.press(words.lease.take);
      await person.press(new RegExp(words.stop.one("virtual")));
      await page.getByText(words.stop.of("virtual", words.stop.stopped("@")).split("@")[0]!.trim()).first().waitFor();
      const control = person.part(words.control.title);
      await person.press(words.control.clearStop, control);
      // The alarm that the stop left is cleared here, and the key is turned at the pendant.
      await page.getByText(words.alarms.remedyOf(42, "switch the servo on"), { exact: false }).first().waitFor();
      await picture(page, `${name}-alarm`);
      await person.press(words.control.clearAlarm, control);
      await says(page, "[data-doing]", words.doing({ kind: "stopped", stands: true }));
      await control.getByText(words.unmet("mode_stop")).waitFor();
      expect(await person.find("button", words.control.prepare).isDisabled()).toBe(true);
      await isAccessible(page);
      await picture(page, `${name}-key`);
      await r6("panel", "--panel", cell.panel, "key", "auto");
      await says(page, "[data-doing]", words.doing({ kind: "waits_for_start", stands: true }));
      await person.press(words.control.prepare);
      await person.hold(words.control.run("virtual"));
      await moves(person);

      // The gateway is lost and comes back: the page says the one, and goes on by itself.
      await network.cut();
      await page.getByRole("alert").first().waitFor();
      await picture(page, `${name}-lost`);
      await network.open();
      await page.getByRole("alert").first().waitFor({ state: "detached" });
      await moves(person);
      expect(faults).toEqual([]);
    } finally {
      await page.context().close();
      await network.cut();
      await cell.up.kill();
    }
  }, LONG);

  test(`an alarm that only the pendant clears, in ${words.name}`, async () => {
    const cell = await cellOf("r6-pendant");
    const { page, faults } = await openPage(browser, { locale });
    try {
      await page.goto(cell.link);
      const person = new Person(page, words);
      await person.follow(/^virtual /);
      await moves(person);
      await r6("panel", "--panel", cell.panel, "alarm", "5001");
      await says(page, "[data-doing]", /5001/);
      await person.press(words.lease.take);
      const control = person.part(words.control.title);
      await person.press(words.control.clearAlarm, control);
      await says(page, "[data-told-command=control]", REFUSED[locale]!);
      await isAccessible(page);
      await picture(page, `${name}-refused`);
      await r6("panel", "--panel", cell.panel, "clear");
      await person.press(words.control.prepare);
      await person.hold(words.control.run("virtual"));
      await moves(person);
      expect(faults).toEqual([]);
    } finally {
      await page.context().close();
      await cell.up.kill();
    }
  }, LONG);
}
