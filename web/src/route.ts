/** The pages by their paths. */

export type Route = { page: "hall" } | { page: "robot"; robot: string } | { page: "unknown" };

/** The page of a path. */
export function routeOf(path: string): Route {
  if (path === "/") return { page: "hall" };
  const robot = /^\/robots\/([^/]+)$/.exec(path)?.[1];
  if (robot === undefined) return { page: "unknown" };
  try {
    return { page: "robot", robot: decodeURIComponent(robot) };
  } catch {
    return { page: "unknown" };
  }
}
