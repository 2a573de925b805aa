/**
 * Where drafts are kept. Some browsers forbid the page to keep anything: then they last as long as the page.
 */
import type { Shelf } from "../../teach/draft.ts";

export const shelf: Shelf = (() => {
  try {
    return localStorage;
  } catch {
    return {
      length: 0,
      key: () => null,
      getItem: () => null,
      removeItem: () => {},
      setItem: () => {
        throw new Error("this browser keeps nothing");
      },
    };
  }
})();
