/** Which stops are in the bar of a page of one robot. */

export interface InBar {
  robot: string;
  /** Whether F9 stops it. F9 stops all robots of the page that may move by it. */
  hasKey: boolean;
}

/**
 * The robot of the page is always there. Its twin is there too while the page works with it or may move it.
 * `target`: which robot the page works with. `mayMove`: whether a run may be under way on a robot, or the page
 * controls it.
 */
export function inBar(page: string, twin: string | null, target: string | null, mayMove: (robot: string) => boolean): InBar[] {
  const own = { robot: page, hasKey: true };
  if (twin === null || twin === page) return [own];
  const moves = mayMove(twin);
  return moves || target === twin ? [{ robot: twin, hasKey: moves }, own] : [own];
}
