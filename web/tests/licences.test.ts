import { mkdirSync, mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { expect, test } from "vitest";
import { folderOf, packageIn, textOf } from "../licences.ts";

test("a module is from the package of the folder that it is in, or from what builds the page", () => {
  const of = (module: string): string | null => folderOf(module, "/web");
  expect(of("/web/node_modules/three/build/three.module.js")).toBe("/web/node_modules/three");
  expect(of("/web/node_modules/@scope/part/src/a.js?v=1")).toBe("/web/node_modules/@scope/part");
  expect(of("/web/node_modules/svelte/node_modules/inner/a.js")).toBe("/web/node_modules/svelte/node_modules/inner");
  expect(of("\0vite/preload-helper.js")).toBe("/web/node_modules/vite");
  expect(of("/web/src/App.svelte?svelte&type=style&lang.css")).toBe(null);
  expect(() => of("\0somebody/helper")).toThrow(/not known which package/);
});

test("a package needs an allowed licence and its text", () => {
  const folder = mkdtempSync(join(tmpdir(), "r6-licences-"));
  const make = (name: string, license: unknown, file: string | null, text = "Do as you like."): string => {
    const of = join(folder, name);
    mkdirSync(of);
    writeFileSync(join(of, "package.json"), JSON.stringify({ name, version: "1.2.3", license }));
    if (file !== null) writeFileSync(join(of, file), text);
    return of;
  };
  try {
    const good = packageIn(make("good", "MIT", "LICENSE.md"));
    expect(good).toEqual({ name: "good", version: "1.2.3", licence: "MIT", text: "Do as you like." });
    expect(textOf([good])).toMatch(/^The dashboard[^]*  good 1\.2\.3 \(MIT\)[^]*Do as you like\.\n$/);
    const bundled = "MIT\n\n# Licenses of bundled dependencies\n## other\nGPL\n";
    expect(packageIn(make("builder", "MIT", "LICENSE", bundled)).text).toBe("MIT");
    expect(() => packageIn(make("copyleft", "GPL-3.0", "LICENSE"))).toThrow(/copyleft 1\.2\.3 with the licence "GPL-3\.0"/);
    expect(() => packageIn(make("unnamed", undefined, "LICENSE"))).toThrow(/unnamed/);
    expect(() => packageIn(make("bare", "MIT", null))).toThrow(/bare 1\.2\.3, which brings no text/);
  } finally {
    rmSync(folder, { recursive: true });
  }
});
