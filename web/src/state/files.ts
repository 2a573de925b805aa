/** The files that a page names. Their names have a hash of their content. */

/** Scripts and style sheets in the text of a page, in no order. */
export function filesIn(html: string): string[] {
  return [...new Set([...html.matchAll(/(?:src|href)="(\/assets\/[^"]+\.(?:js|css))"/g)].map(([, file = ""]) => file))];
}
