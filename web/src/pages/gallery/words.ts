/** The words of the page of components, which come with this page: other pages do not need them. */
import { gallery as en } from "../../i18n/en/gallery.ts";
import { gallery as zh } from "../../i18n/zh/gallery.ts";
import { settings } from "../../state/settings.svelte.ts";

export function wordsOf(): typeof en {
  return settings.language === "zh" ? zh : en;
}
