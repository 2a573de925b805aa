import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { expect, test } from "vitest";

test("the types of the API are those of openapi/gateway.json: npm run types makes them anew", () => {
  const folder = mkdtempSync(join(tmpdir(), "r6-web-"));
  try {
    const made = join(folder, "schema.d.ts");
    const web = new URL("..", import.meta.url);
    const tool = "node_modules/openapi-typescript/bin/cli.js";
    const args = [tool, "../openapi/gateway.json", "--output", made];
    execFileSync(process.execPath, args, { cwd: web, stdio: "pipe" });
    const committed = readFileSync(new URL("src/api/schema.d.ts", web), "utf8");
    expect(committed === readFileSync(made, "utf8")).toBe(true);
  } finally {
    rmSync(folder, { recursive: true });
  }
});

test("the lock file names no registry, so that each machine uses its own", () => {
  const lock = readFileSync(new URL("../package-lock.json", import.meta.url), "utf8");
  const packages = Object.entries((JSON.parse(lock) as { packages: Record<string, object> }).packages);
  expect(packages.length).toBeGreaterThan(50);
  expect(packages.filter(([, entry]) => "resolved" in entry)).toEqual([]);
});
