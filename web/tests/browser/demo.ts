/** The demo hall of examples/hall.toml, in a folder that is kept, and a day before now in it if a test wants one. */
import { execFileSync } from "node:child_process";
import { readFileSync, symlinkSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { Running, folder, hasThisPage, r6 } from "./support.ts";

const EXAMPLES = fileURLToPath(new URL("../../../examples", import.meta.url));

export interface Demo {
  url: string;
  /** The link of the start: it signs in as an admin. */
  link: string;
  /** The time zone of the hall: it is about noon there, so that no test runs over midnight. */
  zone: string;
  /** A token of this role and name. */
  token(role: string, name: string): Promise<string>;
  /** Asks the gateway with a token. */
  ask<T>(token: string, method: string, path: string, body?: object): Promise<T>;
  /** Ends it. What it knows stays. */
  end(): Promise<void>;
}

/** A folder for demo halls, one after the other: the next one knows what the one before knew. */
export class DemoFolder {
  private readonly data = folder();
  private readonly zone = noonZone(new Date());
  private readonly file = join(this.data.path, "hall.toml");

  constructor() {
    for (const beside of ["hall", "programs"]) symlinkSync(join(EXAMPLES, beside), join(this.data.path, beside));
    const text = readFileSync(join(EXAMPLES, "hall.toml"), "utf8");
    const own = text.replace(/^time_zone = .*$/m, `time_zone = "${this.zone}"`);
    if (own === text) throw new Error("examples/hall.toml has no time zone");
    writeFileSync(this.file, own);
  }

  /** Starts the hall. `isYesterday`: its clock shows the time of the day before. */
  async start(isYesterday = false): Promise<Demo> {
    const kept = join(this.data.path, "data");
    if (isYesterday) process.env["LD_PRELOAD"] = this.clockOfYesterday();
    const up = new Running("up", "--cell", this.file, "--gateway", "127.0.0.1:0", "--data", kept);
    delete process.env["LD_PRELOAD"];
    const link = await up.said(/dashboard, .* on (http\S+)/);
    const url = await up.said(/gateway on (http:\/\/[^\s,]+)/);
    await hasThisPage(url);
    return {
      url,
      link,
      zone: this.zone,
      token: async (role, name) => (await r6("gateway", "token", "--data", kept, "--role", role, "--name", name)).trim(),
      ask: async <T>(token: string, method: string, path: string, body?: object): Promise<T> => {
        const headers = { Authorization: `Bearer ${token}`, "Content-Type": "application/json" };
        const answer = await fetch(url + path, { method, headers, ...(body === undefined ? {} : { body: JSON.stringify(body) }) });
        const text = await answer.text();
        if (!answer.ok) throw new Error(`${method} ${path}: ${answer.status} ${text}`);
        return (text === "" ? undefined : JSON.parse(text)) as T;
      },
      end: () => up.kill(),
    };
  }

  remove(): void {
    this.data.remove();
  }

  /** A library for `LD_PRELOAD` that sets the time of day of a program back by a day. */
  private clockOfYesterday(): string {
    const [source, library] = [join(this.data.path, "yesterday.c"), join(this.data.path, "yesterday.so")];
    writeFileSync(source, YESTERDAY);
    execFileSync("cc", ["-shared", "-fPIC", "-o", library, source, "-ldl"]);
    return library;
  }
}

const YESTERDAY = `
#define _GNU_SOURCE
#include <dlfcn.h>
#include <time.h>

int clock_gettime(clockid_t id, struct timespec *time) {
  static int (*of_the_system)(clockid_t, struct timespec *);
  if (!of_the_system) of_the_system = (int (*)(clockid_t, struct timespec *))dlsym(RTLD_NEXT, "clock_gettime");
  int result = of_the_system(id, time);
  if (result == 0 && id == CLOCK_REALTIME) time->tv_sec -= 24 * 60 * 60;
  return result;
}
`;

/** A zone without summer time in which it is between 12 and 13 o'clock. */
function noonZone(now: Date): string {
  const east = 12 - now.getUTCHours();
  // The signs of these names are those of POSIX: west of Greenwich is +.
  return east === 0 ? "Etc/GMT" : `Etc/GMT${east > 0 ? "-" : "+"}${Math.abs(east)}`;
}
