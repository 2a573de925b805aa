/** The pages by their paths. */

/** The pages with a path of one word. The gateway serves the page at each: see its `http/page.rs`. */
export const PLAIN = [
  "alarms",
  "production",
  "history",
  "audit",
  "connections",
  "users",
  "tokens",
  "settings",
  "gallery",
] as const;

export type PlainPage = (typeof PLAIN)[number];

export type Route =
  | { page: "hall" }
  | { page: "robot"; robot: string }
  | { page: "teach"; robot: string; program: string | null }
  | { page: PlainPage }
  | { page: "unknown" };

/** The page of a path. */
export function routeOf(path: string): Route {
  if (path === "/") return { page: "hall" };
  const plain = PLAIN.find((page) => path === `/${page}`);
  if (plain !== undefined) return { page: plain };
  const [, robot, teach, program] = /^\/robots\/([^/]+)(\/teach(?:\/([^/]+))?)?$/.exec(path) ?? [];
  if (robot === undefined) return { page: "unknown" };
  try {
    const name = decodeURIComponent(robot);
    if (teach === undefined) return { page: "robot", robot: name };
    return { page: "teach", robot: name, program: program === undefined ? null : decodeURIComponent(program) };
  } catch {
    return { page: "unknown" };
  }
}
