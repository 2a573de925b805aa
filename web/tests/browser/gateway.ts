/** A gateway with virtual robots and a folder of its own. */
import type { Page } from "playwright-core";
import { Running, fits, folder, hasThisPage, isAccessible, picture, r6, until } from "./support.ts";

export interface Hall {
  url: string;
  /** The secret of the one-time link for the first admin. */
  secret: string;
  /** The addresses of two robots that the gateway does not know: machines of other kinds. */
  spare: [string, string];
  /** Makes a token. */
  token(role: string, ...more: string[]): Promise<string>;
  /** Asks the gateway with a token. */
  ask(token: string, method: string, path: string, body?: unknown): Promise<Response>;
  /** The gateway does nothing any more, and its connections stay open. */
  freeze(): void;
  thaw(): void;
  end(): Promise<void>;
}

/** Robots with these names, and `saw` besides them, with nothing at its address. */
export async function startHall(names: readonly string[]): Promise<Hall> {
  const data = folder();
  const listen = [...names, "spare"].flatMap(() => ["--listen", "127.0.0.1:0"]);
  const robots = new Running("sim", ...listen);
  const other = new Running("sim", "--listen", "127.0.0.1:0", "--model", "GENERIC-SCARA");
  const addresses = await robots.all(/listening on (\S+)/g, names.length + 1);
  const spare: [string, string] = [await other.said(/listening on (\S+)/), addresses[names.length] ?? ""];
  const named = names.flatMap((name, at) => ["--robot", `${name}=${addresses[at]}`]);
  const gateway = new Running("gateway", "--listen", "127.0.0.1:0", "--data", data.path, ...named, "--robot", "saw=127.0.0.1:1");
  const secret = await gateway.said(/\/setup#(\S+)/);
  const url = await gateway.said(/gateway on (http:\/\/[^\s,]+)/);
  await hasThisPage(url);
  return {
    url,
    secret,
    spare,
    token: async (role, ...more) => (await r6("gateway", "token", "--data", data.path, "--role", role, ...more)).trim(),
    ask: (token, method, path, body) => {
      const headers = { Authorization: `Bearer ${token}`, "Content-Type": "application/json" };
      return fetch(`${url}${path}`, { method, headers, ...(body === undefined ? {} : { body: JSON.stringify(body) }) });
    },
    freeze: () => void gateway.process.kill("SIGSTOP"),
    thaw: () => void gateway.process.kill("SIGCONT"),
    end: async () => {
      gateway.process.kill("SIGCONT");
      await gateway.kill();
      await robots.kill();
      await other.kill();
      data.remove();
    },
  };
}

/** Both themes and three widths: the page fits, is accessible, and its pictures are taken. */
export async function looks(page: Page, name: string): Promise<void> {
  for (const theme of ["light", "dark"] as const) {
    await page.emulateMedia({ colorScheme: theme });
    await until(theme, async () => (await page.getAttribute("html", "data-theme")) === theme);
    for (const width of [1920, 768, 390]) {
      await page.setViewportSize({ width, height: width === 390 ? 844 : 1080 });
      await fits(page);
      await picture(page, `${name}-${width}-${theme}`, true);
      // Colours differ by theme, and parts by width.
      if (width === (theme === "light" ? 1920 : 390)) await isAccessible(page);
    }
  }
  await page.setViewportSize({ width: 1920, height: 1080 });
}
