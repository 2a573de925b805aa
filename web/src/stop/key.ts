/**
 * Whether a press of a key is the stop: one for one press, however long. While an input method composes a word, the
 * browser names the key by its place alone.
 */
export function isStopKey({ key, code, repeat }: Pick<KeyboardEvent, "key" | "code" | "repeat">): boolean {
  return isKey({ key, code }) && !repeat;
}

/** Whether it is the key of the stop, also while it is held down. */
export function isKey({ key, code }: Pick<KeyboardEvent, "key" | "code">): boolean {
  return key === "F9" || code === "F9";
}
