/**
 * The licences of what the page is made of: a file of the page that names each package of which code or style is in
 * the bundle, with the text of its licence. A build with a package of another licence, or without a text, fails.
 */
import { readFileSync, readdirSync } from "node:fs";
import { join } from "node:path";
import type { Plugin } from "vite";

/** The file in the built page. `src/pages/settings/licences.ts` links to it. */
export const FILE = "assets/licences.txt";

/** Licences that ask for nothing more than to be named: those of `deny.toml` that packages of npm use. */
const ALLOWED = new Set(["0BSD", "Apache-2.0", "BSD-2-Clause", "BSD-3-Clause", "CC0-1.0", "ISC", "MIT", "Unlicense", "Zlib"]);

/** What packages that build the page put into it, by the beginning of its name there. */
const HELPERS: readonly (readonly [string, string])[] = [
  ["\0vite/", "vite"],
  ["\0rolldown/", "rolldown"],
  ["\0@oxc-project+runtime", "@oxc-project/runtime"],
];

/** From here on the licence of vite is about what vite itself is made of. */
const OF_BUILDER = /^# Licenses of bundled dependencies$[^]*/m;

export interface Package {
  name: string;
  version: string;
  licence: string;
  text: string;
}

/** The folder of the package that a module is from; `null` for modules of the page itself. */
export function folderOf(module: string, root: string): string | null {
  const helper = HELPERS.find(([begin]) => module.startsWith(begin));
  if (helper !== undefined) return join(root, "node_modules", helper[1]);
  const path = module.replace(/^\0/, "").replace(/\?.*$/, "");
  const at = path.lastIndexOf("/node_modules/");
  if (at >= 0) {
    const begin = at + "/node_modules/".length;
    const words = path.slice(begin).split("/");
    return path.slice(0, begin) + words.slice(0, words[0]?.startsWith("@") ? 2 : 1).join("/");
  }
  if (path.startsWith(root)) return null;
  throw new Error(`it is not known which package ${JSON.stringify(module)} is from, and under which licence`);
}

/** The package in a folder. Throws if its licence is not an allowed one, or if it brings no text. */
export function packageIn(folder: string): Package {
  const { name, version, license } = JSON.parse(readFileSync(join(folder, "package.json"), "utf8")) as Record<string, unknown>;
  const what = `${String(name)} ${String(version)}`;
  if (typeof license !== "string" || !ALLOWED.has(license)) {
    throw new Error(`the page contains ${what} with the licence ${JSON.stringify(license)}, which is not in the list of licences.ts`);
  }
  const file = readdirSync(folder).find((one) => /^licen[cs]e(\.(md|txt))?$/i.test(one));
  if (file === undefined) throw new Error(`the page contains ${what}, which brings no text of its licence`);
  const text = readFileSync(join(folder, file), "utf8").replace(OF_BUILDER, "").trim();
  return { name: String(name), version: String(version), licence: license, text };
}

/** All of them as one text. */
export function textOf(packages: Package[]): string {
  const head = "The dashboard of r6 contains code of these packages:\n\n";
  const names = packages.map(({ name, version, licence }) => `  ${name} ${version} (${licence})`).join("\n");
  const rule = "=".repeat(80);
  const each = packages.map(({ name, version, text }) => `\n\n${rule}\n${name} ${version}\n${rule}\n\n${text}`).join("");
  return `${head}${names}${each}\n`;
}

export function licences(): Plugin {
  let root = "";
  return {
    name: "licences",
    configResolved(config) {
      root = config.root;
    },
    generateBundle(_options, bundle) {
      const folders = new Set<string>();
      for (const file of Object.values(bundle)) {
        if (file.type !== "chunk") continue;
        for (const [module, { renderedLength }] of Object.entries(file.modules)) {
          // Styles are in files of their own, and are taken out of the chunk.
          if (renderedLength === 0 && !/\.css(\?|$)/.test(module)) continue;
          const folder = folderOf(module, root);
          if (folder !== null) folders.add(folder);
        }
      }
      const packages = [...folders].map(packageIn).sort((a, b) => (a.name < b.name ? -1 : 1));
      this.emitFile({ type: "asset", fileName: FILE, source: textOf(packages) });
      this.info(packages.map(({ name, licence }) => `${name} (${licence})`).join(", "));
    },
  };
}
