import { configDefaults, defineConfig } from "vitest/config";

// These take most of two processors for minutes: `tools/web tasks` and `tools/web measure` run them alone.
const LONG = ["tests/browser/tasks.test.ts", "tests/browser/load.test.ts"];

export default defineConfig({
  test: {
    include: ["tests/browser/*.test.ts"],
    exclude: process.env["R6_LONG"] === undefined ? [...configDefaults.exclude, ...LONG] : configDefaults.exclude,
    testTimeout: 60_000,
    hookTimeout: 60_000,
    // Each has a browser of several processes and a cell beside it.
    maxWorkers: 2,
  },
});
