/** Binds parts of the page to values that change often, as attachments of Svelte. */
import type { Attachment } from "svelte/attachments";
import { onFrame } from "./frame.ts";

/** The text of an element. */
export function text(read: () => string): Attachment {
  return (node) =>
    onFrame(() => {
      const next = read();
      if (node.textContent !== next) node.textContent = next;
    });
}

/** Whether an element has a class. */
export function marked(name: string, read: () => boolean): Attachment {
  return (node) => onFrame(() => void node.classList.toggle(name, read()));
}
