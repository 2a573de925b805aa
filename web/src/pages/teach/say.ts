/** Steps in a line. */
import { type Document, type Step, doOf, linked, valueAt, wants } from "../../teach/document.ts";
import { isTarget, unitOf } from "../../teach/kinds.ts";
import type { Value } from "../../teach/toml.ts";
import type { en } from "../../i18n/en.ts";

export function numberText(value: number): string {
  return String(Math.round(value * 1000) / 1000);
}

export function valueText(value: Value, words: typeof en): string {
  if (typeof value === "boolean") return value ? words.teach.steps.onWord : words.teach.steps.offWord;
  if (typeof value === "number") return numberText(value);
  if (Array.isArray(value)) return value.map((one) => valueText(one, words)).join(", ");
  return value;
}

/** What a step does: `Axis move P1, 50 %`. */
export function stepText(document: Document, step: Step, words: typeof en): string {
  const own = words.teach.steps;
  const word = doOf(step);
  const name = own.kinds[word] ?? (word === "" ? "?" : word);
  const parts = step.fields
    .filter(({ key }) => key !== "do")
    .map(({ key, value }) => {
      if (wants(word, key) !== null || isTarget(word, key)) {
        const point = linked(document, step, key);
        return point === null ? valueText(value, words) : point.name;
      }
      if (key === "speed" && typeof value === "number") return `${numberText(value)} %`;
      if (key === "point" || key === "name" || key === "program" || key === "on" || key === "until" || key === "to") {
        return valueText(value, words);
      }
      const unit = key === "blend" ? "" : unitOf(word, key);
      if (key === "seconds" || key === "mm_per_s") return `${valueText(value, words)} ${unit}`;
      return `${own.fields[key] ?? key} ${valueText(value, words)}${unit === "" ? "" : ` ${unit}`}`;
    });
  return parts.length === 0 ? name : `${name} ${parts.join(", ")}`;
}

/**
 * The name of a point that a step names although it has other numbers: somebody changed one of them by hand.
 */
export function looseName(document: Document, step: Step, key: string, named: string | null): string | null {
  return named !== null && wants(doOf(step), key) !== null && valueAt(step, key) !== undefined && linked(document, step, key) === null
    ? named
    : null;
}
