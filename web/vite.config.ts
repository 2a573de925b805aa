import { readFileSync } from "node:fs";
import { join } from "node:path";
import { gzipSync } from "node:zlib";
import { svelte } from "@sveltejs/vite-plugin-svelte";
import { defineConfig, type Plugin } from "vite";

/** The most that a browser loads before it shows the first page, in bytes with gzip. */
const BUDGET = 600_000;

/** Fails a build whose first load is over the budget, and says how large it is. */
function budget(): Plugin {
  return {
    name: "budget",
    writeBundle(options, bundle) {
      const folder = options.dir ?? ".";
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
        if (file.type === "chunk" && file.isEntry) add(file.fileName);
      }
      const sizes = [...first].map((name) => gzipSync(readFileSync(join(folder, name))).length);
      const size = sizes.reduce((sum, one) => sum + one, 0);
      this.info(`first load: ${(size / 1000).toFixed(1)} kB of ${BUDGET / 1000} kB with gzip`);
      if (size > BUDGET) this.error(`the first load is over ${BUDGET / 1000} kB`);
    },
  };
}

export default defineConfig({
  plugins: [svelte(), budget()],
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
