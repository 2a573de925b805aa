/** Whether the gateway has another build of the page than the one that is shown. */
import { filesIn } from "./files.ts";

/** What a look at the gateway found: no answer, the build that is shown, or another one. */
export type Found = "away" | "same" | "other";

class Build {
  /** Set once another one was seen. */
  isOld = $state(false);
  readonly #own = filesIn(document.documentElement.outerHTML);

  /** Looks at the page that the gateway has now. It needs no session. */
  async look(): Promise<Found> {
    if (this.isOld) return "other";
    try {
      const response = await fetch("/", { cache: "no-store", signal: AbortSignal.timeout(10_000) });
      if (!response.ok) return "away";
      const now = filesIn(await response.text());
      // A tool for development serves a page that names no files.
      this.isOld = this.#own.length > 0 && now.length > 0 && now.some((file) => !this.#own.includes(file));
      return this.isOld ? "other" : "same";
    } catch {
      // The gateway is lost again. It is asked when the link comes back.
      return "away";
    }
  }
}

export const build = new Build();
