import type { components } from "../../api/schema.d.ts";

export type HistoryEvent = components["schemas"]["HistoryEvent"];
export type HistoryEvents = components["schemas"]["HistoryEvents"];
