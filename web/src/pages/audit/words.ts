/** The words of this page. They come with its chunk: the log has a sentence for each deed, and few people read it. */
import { audit as english } from "../../i18n/en/audit.ts";
import { guarded } from "../../i18n/plain.ts";
import { audit as chinese } from "../../i18n/zh/audit.ts";
import { settings } from "../../state/settings.svelte.ts";

const LANGUAGES = { en: guarded(english), zh: guarded(chinese) };

export function auditWords(): typeof english {
  return LANGUAGES[settings.language];
}
