/**
 * Turns a picture with a mouse, with two fingers, with the wheel and with keys. One finger scrolls the page,
 * and so does the wheel until somebody chose the picture: nothing turns by accident.
 */
import type { Scene } from "./scene.ts";

/** How far a pixel and a key turn, in radians, and how near a key and a step of the wheel bring it. */
const PIXEL = 0.008;
const KEY = 0.12;
const NEARER = 1.15;

const KEYS: Record<string, (scene: Scene) => void> = {
  ArrowLeft: (scene) => scene.turn(-KEY, 0),
  ArrowRight: (scene) => scene.turn(KEY, 0),
  ArrowUp: (scene) => scene.turn(0, KEY),
  ArrowDown: (scene) => scene.turn(0, -KEY),
  "+": (scene) => scene.zoom(NEARER),
  "-": (scene) => scene.zoom(1 / NEARER),
};

/** `node` is what gets the focus: the picture and what lies over it. Returns what ends it. */
export function turning(node: HTMLElement, scene: Scene): () => void {
  const fingers = new Map<number, { x: number; y: number }>();
  const over = new AbortController();
  const on = <Kind extends keyof HTMLElementEventMap>(
    kind: Kind,
    act: (event: HTMLElementEventMap[Kind]) => void,
  ): void => node.addEventListener(kind, act, { signal: over.signal, passive: false });
  const gone = (event: PointerEvent): void => void fingers.delete(event.pointerId);

  on("pointerdown", (event) => {
    if (!(event.target instanceof HTMLCanvasElement) || (event.pointerType === "mouse" && event.button !== 0)) return;
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (event.pointerType !== "touch") event.target.setPointerCapture(event.pointerId);
  });
  on("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (before === undefined) return;
    const now = { x: event.clientX, y: event.clientY };
    fingers.set(event.pointerId, now);
    if (event.pointerType !== "touch") {
      scene.turn((before.x - now.x) * PIXEL, (now.y - before.y) * PIXEL);
      return;
    }
    const other = [...fingers].find(([id]) => id !== event.pointerId)?.[1];
    if (other === undefined) return;
    // Each of two fingers tells half of the way.
    scene.turn(((before.x - now.x) * PIXEL) / 2, ((now.y - before.y) * PIXEL) / 2);
    const far = (of: { x: number; y: number }): number => Math.max(1, Math.hypot(of.x - other.x, of.y - other.y));
    scene.zoom(far(now) / far(before));
  });
  on("pointerup", gone);
  on("pointercancel", gone);
  on("touchmove", (event) => {
    if (event.touches.length > 1) event.preventDefault();
  });
  on("wheel", (event) => {
    if (!event.ctrlKey && document.activeElement !== node) return;
    event.preventDefault();
    scene.zoom(event.deltaY < 0 ? NEARER : 1 / NEARER);
  });
  on("keydown", (event) => {
    const act = KEYS[event.key];
    if (act === undefined || event.target !== node || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    act(scene);
  });
  return () => over.abort();
}
