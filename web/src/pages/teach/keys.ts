/**
 * What keys do on the teach page. None acts in a text field, on a control of its own, or while characters are
 * composed.
 */

export type Act = "up" | "down" | "edit" | "move_up" | "move_down" | "copy" | "undo" | "redo" | "play";

type Key = Pick<KeyboardEvent, "key" | "altKey" | "ctrlKey" | "metaKey" | "shiftKey" | "isComposing" | "keyCode"> & {
  target: EventTarget | null;
};

/** `null` if the key is not for the page. `hasDialog`: whether a dialog is open. */
export function keyOf(event: Key, hasDialog: boolean): Act | null {
  // Some browsers send keys of an input method with 229 and without `isComposing`.
  if (event.isComposing || event.keyCode === 229 || hasDialog) return null;
  const place = placeOf(event.target);
  if (place === "text" || place === "picture") return null;
  const command = event.ctrlKey || event.metaKey;
  const { key } = event;
  if (command && !event.altKey) {
    if (key.toLowerCase() === "z") return event.shiftKey ? "redo" : "undo";
    if (key.toLowerCase() === "d" && !event.shiftKey) return "copy";
    return null;
  }
  if (command || event.shiftKey) return null;
  if (key === "ArrowUp") return event.altKey ? "move_up" : "up";
  if (key === "ArrowDown") return event.altKey ? "move_down" : "down";
  if (event.altKey) return null;
  // Buttons and links act on these themselves. On the row of a step, which is chosen already, they are the
  // page's.
  if (key === "Enter") return place === "control" ? null : "edit";
  if (key === " ") return place === "control" ? null : "play";
  return null;
}

function placeOf(target: EventTarget | null): "text" | "control" | "row" | "picture" | null {
  if (target === null || typeof (target as Element).closest !== "function") return null;
  const element = target as Element;
  if (element.closest("input, textarea, select, [contenteditable]") !== null) return "text";
  if (element.closest("[role=application]") !== null) return "picture";
  if (element.closest("[data-step] .row") !== null) return "row";
  return element.closest("button, a, summary") === null ? null : "control";
}
