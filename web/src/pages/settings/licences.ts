/** Where the licences are of what the page is made of: a file that `web/licences.ts` writes when the page is built. */

/** Browsers keep files of the page for ever. The name of this one stays, so the name of this build is behind it. */
const BUILD = /[^/]*$/.exec(import.meta.url)?.[0] ?? "";

export const LICENCES = `/assets/licences.txt?${BUILD}`;
