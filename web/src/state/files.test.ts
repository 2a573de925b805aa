import { expect, test } from "vitest";
import { filesIn } from "./files.ts";

test("the files of a page are those with a hash in their names", () => {
  const html = `<link rel="icon" href="/assets/icon-Lw.svg"><script type="module" crossorigin src="/assets/index-TpW.js"></script>
    <link rel="stylesheet" crossorigin href="/assets/index-Bo.css"><script src="https://elsewhere/x.js"></script>`;
  expect(filesIn(html)).toEqual(["/assets/index-TpW.js", "/assets/index-Bo.css"]);
  expect(filesIn("<p>The gateway was built without the dashboard.</p>")).toEqual([]);
});
