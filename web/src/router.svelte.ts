/** Which page is shown: the path and the query of the address. */
import { type Route, routeOf } from "./route.ts";

class Router {
  route = $state.raw<Route>(routeOf(location.pathname));
  search = $state(new URLSearchParams(location.search).get("q") ?? "");

  constructor() {
    addEventListener("popstate", () => this.#read());
    // Links within the page need no new page.
    addEventListener("click", (event) => {
      const link = event.target instanceof Element ? event.target.closest("a") : null;
      const isPlain = !event.defaultPrevented && event.button === 0;
      if (link === null || !isPlain || event.metaKey || event.ctrlKey || event.shiftKey || event.altKey) return;
      if (link.origin !== location.origin || link.hash !== "" || link.target !== "") return;
      if (routeOf(link.pathname).page === "unknown") return;
      event.preventDefault();
      this.go(link.pathname + link.search);
    });
  }

  go(path: string): void {
    history.pushState(null, "", path);
    this.#read();
    scrollTo(0, 0);
  }

  /** Searches. The address says it too, so that it can be passed on. */
  find(text: string): void {
    this.search = text;
    const query = text === "" ? "" : `?${new URLSearchParams({ q: text })}`;
    history.replaceState(null, "", location.pathname + query);
  }

  #read(): void {
    this.route = routeOf(location.pathname);
    this.search = new URLSearchParams(location.search).get("q") ?? "";
  }
}

export const router = new Router();
