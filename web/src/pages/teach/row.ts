/** Rows of the list of steps. */
import { tick } from "svelte";

/** Brings a step, from 0, into view. The row has the focus then if a row had it. */
export function showStep(number: number): void {
  const hadFocus = document.activeElement?.closest("[data-step]") != null;
  void tick().then(() => {
    const row = document.querySelector<HTMLElement>(`[data-step="${number + 1}"] .row`);
    row?.scrollIntoView({ block: "nearest" });
    if (hadFocus) row?.focus();
  });
}
