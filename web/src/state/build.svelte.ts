/** Whether the gateway has another build of the page than the one that is shown. */
import { filesIn } from "./files.ts";

class Build {
  /** Set once another one was seen. */
  isOld = $state(false);
  readonly #own = filesIn(document.documentElement.outerHTML);

  /** Looks at the page that the gateway has now. Without an answer, nothing is known. It needs no session. */
  async look(): Promise<void> {
    if (this.isOld || this.#own.length === 0) return;
    try {
      const response = await fetch("/", { cache: "no-store", signal: AbortSignal.timeout(10_000) });
      if (!response.ok) return;
      const now = filesIn(await response.text());
      this.isOld = now.length > 0 && now.some((file) => !this.#own.includes(file));
    } catch {
      // The gateway is lost again. It is asked when the link comes back.
    }
  }
}

export const build = new Build();
