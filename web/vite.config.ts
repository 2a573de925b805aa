import { readFileSync } from "node:fs";
import { join } from "node:path";
import { gzipSync } from "node:zlib";
import { svelte } from "@sveltejs/vite-plugin-svelte";
import { defineConfig, type Plugin } from "vite";
import { licences } from "./licences.ts";

/** The most that all files of the page may be, in bytes with gzip: what a browser loads that opens every page. */
const ALL = 600_000;
/** The most that a browser loads before it shows the first page. */
const FIRST = 150_000;

/** Fails a build that is over the budget, and says how large the first page, the chunks of others and all are. */
function budget(): Plugin {
  return {
    name: "budget",
    writeBundle(options, bundle) {
      const folder = options.dir ?? ".";
      const size = (name: string): number => gzipSync(readFileSync(join(folder, name))).length;
      const sum = (names: Iterable<string>): number => [...names].reduce((total, name) => total + size(name), 0);
      const say = (bytes: number): string => `${(bytes / 1000).toFixed(1)} kB`;
      const first = new Set<string>(["index.html"]);
      const add = (name: string): void => {
        const file = bundle[name];
        if (file === undefined || first.has(name)) return;
        first.add(name);
        if (file.type === "chunk") {
          file.imports.forEach(add);
          file.viteMetadata?.importedCss.forEach((css) => first.add(css));
        }
      };
      for (const file of Object.values(bundle)) {
        // The worker is loaded with the first page, and is no part of it.
        if ((file.type === "chunk" && file.isEntry) || /^assets\/worker-/.test(file.fileName)) add(file.fileName);
      }
      const later = Object.keys(bundle).filter((name) => !first.has(name) && /\.(js|css)$/.test(name));
      const chunks = later.map((name) => [name, size(name)] as const).sort(([, one], [, other]) => other - one);
      const all = sum(first) + sum(later);
      this.info(`first page: ${say(sum(first))} of ${say(FIRST)} with gzip`);
      this.info(`loaded later, the largest: ${chunks.slice(0, 5).map(([name, bytes]) => `${name} ${say(bytes)}`).join(", ")}`);
      this.info(`all: ${say(all)} of ${say(ALL)} with gzip`);
      if (sum(first) > FIRST) this.error(`the first page is over ${say(FIRST)}`);
      if (all > ALL) this.error(`the page is over ${say(ALL)}`);
    },
  };
}

export default defineConfig({
  plugins: [svelte(), licences(), budget()],
  build: {
    outDir: "../crates/r6-gateway/page/built",
    emptyOutDir: true,
    target: "es2022",
    // The policy of the page allows files of the gateway alone: no data URLs and no inline scripts.
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    reportCompressedSize: false,
  },
});
