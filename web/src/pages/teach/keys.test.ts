import { expect, test } from "vitest";
import { keyOf } from "./keys.ts";

/** A target inside an element that these selectors match. */
function inside(...matches: string[]): EventTarget {
  return { closest: (selector: string) => (matches.some((one) => selector.includes(one)) ? {} : null) } as unknown as EventTarget;
}

const press = (key: string, more: object = {}, target: EventTarget | null = null, hasDialog = false) =>
  keyOf({ key, altKey: false, ctrlKey: false, metaKey: false, shiftKey: false, isComposing: false, keyCode: 0, target, ...more }, hasDialog);

test("each key does its part", () => {
  const ctrl = { ctrlKey: true };
  expect([
    press("ArrowUp"),
    press("ArrowDown"),
    press("ArrowUp", { altKey: true }),
    press("ArrowDown", { altKey: true }),
    press("Enter"),
    press(" "),
    press("d", ctrl),
    press("z", ctrl),
    press("Z", { ...ctrl, shiftKey: true }),
    press("z", { metaKey: true }),
  ]).toEqual(["up", "down", "move_up", "move_down", "edit", "play", "copy", "undo", "redo", "undo"]);
  for (const [key, more] of [["d", {}], ["z", {}], ["ArrowUp", ctrl], ["ArrowUp", { shiftKey: true }], ["F9", {}], ["Enter", { altKey: true }], ["x", ctrl]] as const) {
    expect(press(key, more), key).toBeNull();
  }
});

test("no key acts while characters are composed, in a text field, in a picture or behind a dialog", () => {
  for (const key of ["ArrowUp", "ArrowDown", "Enter", " "]) {
    expect(press(key, { isComposing: true })).toBeNull();
    expect(press(key, { keyCode: 229 })).toBeNull();
    expect(press(key, {}, null, true)).toBeNull();
    for (const place of ["input", "textarea", "select", "application"]) expect(press(key, {}, inside(place)), place).toBeNull();
  }
  expect(press("z", { ctrlKey: true }, inside("input")), "the field has an undo of its own").toBeNull();
});

test("a button keeps Enter and Space, the row of a step does not", () => {
  expect([press("Enter", {}, inside("button")), press(" ", {}, inside("button"))]).toEqual([null, null]);
  expect(press("ArrowDown", {}, inside("button"))).toBe("down");
  expect([press("Enter", {}, inside(".row", "button")), press(" ", {}, inside(".row", "button"))]).toEqual(["edit", "play"]);
});
