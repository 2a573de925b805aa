/** The colours of the picture, from the tokens of the page, so that both themes have their own. */

export const TOKENS = {
  page: "--surface",
  arm: "--edge",
  joint: "--muted",
  line: "--line",
  text: "--text",
  muted: "--muted",
  accent: "--accent",
  virtual: "--virtual-fill",
  ok: "--path-ok",
  near: "--path-near",
  beyond: "--path-beyond",
  singular: "--path-singular",
  j1: "--j1",
  j2: "--j2",
  j3: "--j3",
  j4: "--j4",
  j5: "--j5",
  j6: "--j6",
} as const;

export type Colours = Record<keyof typeof TOKENS, string>;

/** What the tokens are now, as `#rrggbb`. */
export function coloursOf(element: Element): Colours {
  const style = getComputedStyle(element);
  const read = Object.entries(TOKENS).map(([name, token]) => [name, style.getPropertyValue(token).trim()]);
  return Object.fromEntries(read) as Colours;
}
