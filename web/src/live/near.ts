/** Tells parts of the page whether they are in view, or near it. */
import type { Attachment } from "svelte/attachments";

/** How far from what the screen shows something is near: as much as people scroll before the next frame. */
const MARGIN = "400px 0px";

const told = new WeakMap<Element, (isNear: boolean) => void>();
/** One for all parts: each observer looks at the whole page. */
let observer: IntersectionObserver | null = null;

/** Calls this when the element comes near, and when it is far again. */
export function near(tell: (isNear: boolean) => void): Attachment {
  return (node) => {
    observer ??= new IntersectionObserver(
      (seen) => {
        for (const { target, isIntersecting } of seen) told.get(target)?.(isIntersecting);
      },
      { rootMargin: MARGIN },
    );
    const watching = observer;
    told.set(node, tell);
    watching.observe(node);
    return () => {
      watching.unobserve(node);
      told.delete(node);
    };
  };
}
