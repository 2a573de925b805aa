/** Files for the person at this browser: what the gateway answers, in its own formats. */
import type { Answer, File } from "./client.ts";
import { inFileName, plainTable } from "../i18n/plain.ts";
import { file } from "./client.ts";
import { PATIENCE } from "./patiently.ts";

export const CSV = "text/csv";
export const PARQUET = "application/vnd.apache.parquet";

/** Puts a file into the downloads of the browser. */
export function save(bytes: Blob, name: string): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(bytes);
  link.download = inFileName(name);
  link.target = "_blank";
  document.body.append(link);
  link.click();
  link.remove();
  // The browser has begun to read it by then.
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}

/** Tables of one kind as one: the line of the names stands in it once. Hidden characters are visible. */
export function joined(tables: string[]): string {
  return tables.map((table, at) => plainTable(at === 0 ? table : table.slice(table.indexOf("\n") + 1))).join("");
}

/** How many pages of an answer are read. */
const PAGES = 1_000;

/** All pages of an answer, in order. `more` gets how many there are so far. */
export async function pagesOf(
  path: string,
  type: string,
  signal: AbortSignal,
  more: (pages: number) => void = () => {},
): Promise<Answer<{ files: Blob[]; isWhole: boolean }>> {
  const pages: Blob[] = [];
  let cursor: string | null = null;
  do {
    const at: string = cursor === null ? path : `${path}&cursor=${encodeURIComponent(cursor)}`;
    const answer: Answer<File> = await file(at, type, { signal, patience: PATIENCE });
    if (answer.kind !== "ok") return answer;
    pages.push(answer.value.bytes);
    cursor = answer.value.next;
    more(pages.length);
  } while (cursor !== null && pages.length < PAGES);
  return { kind: "ok", value: { files: pages, isWhole: cursor === null } };
}
