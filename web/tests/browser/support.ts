/** Robots, gateways and browsers for the tests. */
import { type ChildProcess, execFile, spawn } from "node:child_process";
import { mkdirSync, mkdtempSync, readFileSync, rmSync } from "node:fs";
import { type AddressInfo, type Server, type Socket, connect, createServer } from "node:net";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { promisify } from "node:util";
import { type Browser, type BrowserContextOptions, type Page, chromium } from "playwright-core";
import { expect } from "vitest";

const ROOT = fileURLToPath(new URL("../../../", import.meta.url));
/** The command. `make test` has built it. */
const R6 = process.env["R6"] ?? join(ROOT, process.env["CARGO_TARGET_DIR"] ?? "target", "debug/r6");
/** Where pictures go. With R6_IMAGES=1, those of the documentation go there. */
const IMAGES = join(ROOT, "target/web-images");
const DOCUMENTED = join(ROOT, "docs/images");

/** How long a test waits for something, in milliseconds. A busy machine is slow. */
export const PATIENCE = 20_000;

/** Runs a command to its end. Returns what it printed. */
export async function r6(...args: string[]): Promise<string> {
  return (await promisify(execFile)(R6, args)).stdout;
}

/** A program that runs until the test ends it. */
export class Running {
  private text = "";
  private waiting: (() => void)[] = [];
  readonly process: ChildProcess;

  constructor(...args: string[]) {
    this.process = spawn(R6, args, { stdio: ["ignore", "pipe", "pipe"] });
    for (const output of [this.process.stdout, this.process.stderr]) {
      output?.on("data", (bytes: Buffer) => {
        this.text += bytes.toString();
        this.waiting.splice(0).forEach((look) => look());
      });
    }
  }

  /** Waits until its output matches. Returns the first group. */
  async said(pattern: RegExp): Promise<string> {
    const end = Date.now() + PATIENCE;
    for (;;) {
      const found = pattern.exec(this.text)?.[1];
      if (found !== undefined) return found;
      if (Date.now() > end) throw new Error(`${pattern} never came:\n${this.text}`);
      await new Promise<void>((next) => {
        this.waiting.push(next);
        setTimeout(next, 200);
      });
    }
  }

  /** Waits until its output matches so often. Returns the first group of each. */
  async all(pattern: RegExp, count: number): Promise<string[]> {
    let found: string[] = [];
    await until(`${count} of ${pattern}`, async () => {
      found = [...this.text.matchAll(pattern)].map((match) => match[1] ?? "");
      return Promise.resolve(found.length >= count);
    });
    return found;
  }

  async kill(signal: NodeJS.Signals = "SIGTERM"): Promise<void> {
    if (this.process.exitCode !== null || this.process.signalCode !== null) return;
    const ended = new Promise((next) => this.process.once("exit", next));
    this.process.kill(signal);
    await ended;
  }
}

/** A whole cell: `r6 up` with a virtual robot. */
export interface Cell {
  up: Running;
  /** The address of the robot, of its panel, of the gateway; the link that signs in. */
  robot: string;
  panel: string;
  gateway: string;
  link: string;
}

export async function startCell(...more: string[]): Promise<Cell> {
  const here = "127.0.0.1:0";
  const up = new Running("up", "--listen", here, "--gateway", here, "--panel", here, ...more);
  const robot = await up.said(/listening on (\S+)/);
  const panel = await up.said(/panel on http:\/\/(\S+)/);
  const gateway = await up.said(/gateway on (http:\/\/[^\s,]+)/);
  const link = await up.said(/dashboard, .* on (http\S+)/);
  await hasThisPage(gateway);
  return { up, robot, panel, gateway, link };
}

/** Fails if the command was built with another page than the one under test. */
export async function hasThisPage(gateway: string): Promise<void> {
  const served = await (await fetch(gateway)).text();
  const built = readFileSync(join(ROOT, "crates/r6-gateway/page/built/index.html"), "utf8");
  if (served !== built) throw new Error("the gateway has another page in it: build the command again");
}

/** A folder that goes with the test. */
export function folder(): { path: string; remove(): void } {
  const path = mkdtempSync(join(tmpdir(), "r6-web-"));
  return { path, remove: () => rmSync(path, { recursive: true, force: true }) };
}

/** Between browser and gateway: a network that a test can cut. */
export class Network {
  private server: Server;
  private port = 0;
  private readonly sockets = new Set<Socket>();
  /** Whether bytes go through. They are lost if not, and the connections stay open. */
  isSilent = false;
  /** How late what the gateway says comes, in milliseconds. */
  delay = 0;
  /** The next request with this in its head reaches the gateway, and its connection breaks before the answer. */
  breaks: string | null = null;

  constructor(private readonly target: { host: string; port: number }) {
    this.server = this.make();
  }

  private make(): Server {
    return createServer((near) => {
      const far = connect(this.target);
      let isBroken = false;
      for (const [from, to] of [
        [near, far],
        [far, near],
      ] as const) {
        this.sockets.add(from);
        let way = Promise.resolve();
        from.on("data", (bytes) => {
          if (this.isSilent) return;
          if (from === near && this.breaks !== null && bytes.includes(this.breaks)) {
            this.breaks = null;
            isBroken = true;
          } else if (from === far && isBroken) {
            near.destroy();
            return;
          }
          const due = Date.now() + (from === far ? this.delay : 0);
          // Bytes keep their order.
          way = way.then(async () => {
            if (due > Date.now()) await new Promise((next) => setTimeout(next, due - Date.now()));
            if (to.writable) to.write(bytes);
          });
        });
        from.on("error", () => to.destroy());
        from.on("close", () => {
          this.sockets.delete(from);
          to.destroy();
        });
      }
    });
  }

  async open(): Promise<string> {
    await new Promise<void>((next) => this.server.listen(this.port, "127.0.0.1", next));
    this.port = (this.server.address() as AddressInfo).port;
    return `http://127.0.0.1:${this.port}`;
  }

  /** Nothing listens any more, and no connection is left. */
  async cut(): Promise<void> {
    const closed = new Promise<void>((next) => this.server.close(() => next()));
    this.sockets.forEach((socket) => socket.destroy());
    await closed;
    this.server = this.make();
  }
}

/** Lets chromium draw WebGL without a graphics card. */
export const SOFTWARE_3D = "--enable-unsafe-swiftshader";

/** `drawing`: `SOFTWARE_3D` for tests of the picture. It takes a core, so the others have no WebGL at all. */
export async function startBrowser(drawing = "--disable-3d-apis"): Promise<Browser> {
  const executablePath = process.env["R6_CHROMIUM"] ?? "/usr/bin/chromium";
  // Root has no sandbox. The pages are our own.
  return chromium.launch({ executablePath, args: ["--no-sandbox", "--disable-dev-shm-usage", drawing] });
}

/**
 * A page in a browser of its own. Each mistake that the page reports, and each foreign request, fails the
 * test.
 */
export async function openPage(
  browser: Browser,
  options: BrowserContextOptions = {},
): Promise<{ page: Page; faults: string[] }> {
  const context = await browser.newContext({ viewport: { width: 1920, height: 1080 }, locale: "en-GB", ...options });
  const page = await context.newPage();
  page.setDefaultTimeout(PATIENCE);
  const faults: string[] = [];
  page.on("pageerror", (error) => faults.push(error.message));
  page.on("console", (message) => {
    // A lost gateway and a refused sign-in are told by the browser too, and that pictures of WebGL are slow;
    // without a gateway, axe cannot read the style sheets again.
    const isExpected = /Failed to load resource|WebSocket connection to|GL Driver Message|^Couldn't load preload assets/.test(message.text());
    if ((message.type() === "error" || message.type() === "warning") && !isExpected) faults.push(message.text());
  });
  page.on("request", (request) => {
    if (!/^(http|ws):\/\/127\.0\.0\.1:/.test(request.url())) faults.push(`foreign request: ${request.url()}`);
  });
  return { page, faults };
}

/** Waits until this holds. */
export async function until(what: string, holds: () => Promise<boolean>): Promise<void> {
  const end = Date.now() + PATIENCE;
  while (!(await holds())) {
    if (Date.now() > end) throw new Error(`it never came: ${what}`);
    await new Promise((next) => setTimeout(next, 20));
  }
}

/** Waits until an element has this text. */
export async function says(page: Page, selector: string, text: string | RegExp): Promise<void> {
  let last: string | null = null;
  await until(`${selector} says ${text}; last ${last}`, async () => {
    last = await page.textContent(selector);
    return last !== null && (typeof text === "string" ? last.includes(text) : text.test(last));
  }).catch((error: unknown) => {
    throw new Error(`${String(error)}; last: ${last}`);
  });
}

const AXE = readFileSync(join(ROOT, "web/node_modules/axe-core/axe.min.js"), "utf8");

/** Nothing that keeps people from using the page, as far as a program sees it. */
export async function isAccessible(page: Page): Promise<void> {
  await page.evaluate(AXE);
  const found = await page.evaluate(async () => {
    const { axe } = window as unknown as { axe: typeof import("axe-core") };
    const { violations } = await axe.run(document, { resultTypes: ["violations"] });
    return violations.map(({ id, help, nodes }) => `${id}: ${help}: ${nodes.map((node) => node.html).join(" | ")}`);
  });
  expect(found).toEqual([]);
}

/** No part of the page is wider than the screen. */
export async function fits(page: Page): Promise<void> {
  const [wide, screen] = await page.evaluate(() => [document.documentElement.scrollWidth, innerWidth] as const);
  expect(wide).toBeLessThanOrEqual(screen);
}

/**
 * The labels of parts that are scrolled sideways. Each of them can have the focus, which keys need, and says that it
 * scrolls.
 */
export async function sideways(page: Page): Promise<string[]> {
  const found = await page.evaluate(() =>
    [...document.querySelectorAll("main *")]
      .filter((one) => /auto|scroll/.test(getComputedStyle(one).overflowX) && one.scrollWidth > one.clientWidth + 1)
      .map((one) => ({
        label: one.getAttribute("aria-label") ?? one.outerHTML.slice(0, 80),
        isReached: one.getAttribute("tabindex") === "0",
        isTold: one.nextElementSibling?.matches("[data-scrolls]") === true,
      })),
  );
  for (const { label, isReached, isTold } of found) {
    expect([isReached, isTold], `${label}: is it reached with keys, and does it say that it scrolls`).toEqual([true, true]);
  }
  return found.map(({ label }) => label);
}

export async function picture(page: Page, name: string, fullPage = false): Promise<void> {
  const folder = process.env["R6_IMAGES"] === "1" && name.startsWith("dashboard-") ? DOCUMENTED : IMAGES;
  mkdirSync(folder, { recursive: true });
  await page.screenshot({ path: join(folder, `${name}.png`), fullPage });
}
