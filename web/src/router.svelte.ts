/** Which page is shown: the path and the query of the address. */
import { type Route, routeOf } from "./route.ts";

class Router {
  route = $state.raw<Route>(routeOf(location.pathname));
  /** What stands behind `?` in the address. Robots, spans and filters are there, so that a link has them too. */
  query = $state.raw(new URLSearchParams(location.search));

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

  get search(): string {
    return this.query.get("q") ?? "";
  }

  find(text: string): void {
    this.choose({ q: text });
  }

  /** Changes parts of the query. An empty text takes a part away. */
  choose(parts: Record<string, string>): void {
    const query = new URLSearchParams(this.query);
    for (const [key, value] of Object.entries(parts)) {
      if (value === "") query.delete(key);
      else query.set(key, value);
    }
    this.query = query;
    const text = query.toString();
    history.replaceState(null, "", location.pathname + (text === "" ? "" : `?${text}`));
  }

  #read(): void {
    this.route = routeOf(location.pathname);
    this.query = new URLSearchParams(location.search);
  }
}

export const router = new Router();
