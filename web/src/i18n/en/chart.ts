/** Charts and spans. */
import type { Span } from "../../chart/range.ts";
import { count } from "./say.ts";

const SPANS: Record<Span, string> = { "1m": "1 min", "15m": "15 min", "8h": "8 h", "7d": "7 days", "1y": "1 year" };

export const chart = {
  title: "Charts",
  span: "Span",
  spans: (span: Span) => SPANS[span],
  own: "From … to …",
  from: "From",
  to: "To",
  show: "Show",
  zone: (zone: string) => `Times of the hall (${zone})`,
  wrong: "The end has to be behind the begin, by ten years at most.",
  canvas: (robot: string, names: string) => `Chart of ${robot}: ${names}. The table below says the same.`,
  hint: "Line: mean. Band: from the lowest to the highest value. A break in the line: no value.",
  gap: "no value",
  noNumber: "no number",
  part: (percent: number) => (percent < 1 ? "under 1 % seen" : `${percent} % seen`),
  reading: (done: number, all: number) => `Reading the history… ${done} of ${all}`,
  empty: "No value was kept in this span. Choose another span, or another signal.",
  first: (at: string) => `This span has no value before ${at}.`,
  unreadable: (n: number) => `${count(n, "part of the history", "parts of the history")} cannot be read and are missing.`,
  averages: (minutes: number, lacks: boolean) =>
    `values are gone, averages of ${minutes < 60 ? `${minutes} min` : `${minutes / 60} h`} are left.${lacks ? " They lack some of the values." : ""}`,
  tooMuch: "There is more than this page reads. Choose a shorter span.",
  table: "As a table",
  time: "From",
  whole: "Whole span",
  legend: "Mean over the time with a value (lowest … highest). “40 % seen”: there was a value for that part of the time.",
  more: "More signals and robots in the history",
};
