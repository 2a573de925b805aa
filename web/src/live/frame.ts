/** Writes what changes often into the page: once a frame at most, outside the framework. */

const updaters = new Set<() => void>();
let scheduled = false;

/** Asks for a frame: something changed. */
export function touch(): void {
  if (scheduled) return;
  scheduled = true;
  requestAnimationFrame(() => {
    scheduled = false;
    for (const update of updaters) update();
  });
}

/** Calls this now and with each frame. Returns what ends it. */
export function onFrame(update: () => void): () => void {
  updaters.add(update);
  update();
  return () => updaters.delete(update);
}
