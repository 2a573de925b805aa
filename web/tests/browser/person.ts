/** A person at a page: finds things by the role and the words that a person sees, and each press or entry counts. */
import type { Locator, Page } from "playwright-core";
import type { en } from "../../src/i18n/en.ts";

type Role = Parameters<Page["getByRole"]>[0];
type Name = string | RegExp;

export class Person {
  actions = 0;

  constructor(
    readonly page: Page,
    readonly words: typeof en,
  ) {}

  /** A part of the page by its heading. */
  part(name: Name): Locator {
    return this.page.getByRole("region", { name, exact: typeof name === "string" });
  }

  find(role: Role, name: Name, where: Page | Locator = this.page): Locator {
    return where.getByRole(role, { name, exact: typeof name === "string" });
  }

  async press(name: Name, where?: Page | Locator): Promise<void> {
    this.actions += 1;
    await this.find("button", name, where).click();
  }

  async follow(name: Name, where?: Page | Locator): Promise<void> {
    this.actions += 1;
    await this.find("link", name, where).click();
  }

  async enter(label: Name, text: string, where: Page | Locator = this.page): Promise<void> {
    this.actions += 1;
    await where.getByLabel(label, { exact: typeof label === "string" }).fill(text);
  }

  /** `label`: a part of its label, which has the texts of all options behind it. */
  async choose(label: string, option: string, where: Page | Locator = this.page): Promise<void> {
    this.actions += 1;
    await where.locator("label").filter({ hasText: label }).getByRole("combobox").selectOption({ label: option });
  }

  /** Holds a button for as long as it has to be held: its dialog closes then. */
  async hold(name: Name): Promise<void> {
    this.actions += 1;
    const button = this.find("button", name);
    await button.scrollIntoViewIfNeeded();
    await button.hover();
    await this.page.mouse.down();
    await button.waitFor({ state: "detached" });
    await this.page.mouse.up();
  }
}
