/** What the person at this browser chose. It is kept in the browser. */
import { en } from "../i18n/en.ts";
import { guarded } from "../i18n/plain.ts";
import { zh } from "../i18n/zh.ts";

export type Language = "en" | "zh";
export type Theme = "system" | "light" | "dark";

const LANGUAGES = { en: guarded(en), zh: guarded(zh) };
const THEMES: readonly Theme[] = ["system", "light", "dark"];

/** Browsers that keep nothing, in a private window for example, throw. */
function kept(key: string): string | null {
  try {
    return localStorage.getItem(key);
  } catch {
    return null;
  }
}

function keep(key: string, value: string): void {
  try {
    localStorage.setItem(key, value);
  } catch {
    // It holds until the page is closed.
  }
}

class Settings {
  language = $state<Language>(firstLanguage());
  theme = $state<Theme>(firstTheme());
  #dark = $state(matchMedia("(prefers-color-scheme: dark)").matches);

  constructor() {
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", (event) => {
      this.#dark = event.matches;
    });
  }

  get words(): typeof en {
    return LANGUAGES[this.language];
  }

  get isDark(): boolean {
    return this.theme === "dark" || (this.theme === "system" && this.#dark);
  }

  choose(part: { language?: Language; theme?: Theme }): void {
    if (part.language !== undefined) keep("r6-language", (this.language = part.language));
    if (part.theme !== undefined) keep("r6-theme", (this.theme = part.theme));
  }
}

function firstLanguage(): Language {
  const chosen = kept("r6-language");
  if (chosen === "en" || chosen === "zh") return chosen;
  return navigator.language.toLowerCase().startsWith("zh") ? "zh" : "en";
}

function firstTheme(): Theme {
  const chosen = kept("r6-theme");
  return THEMES.find((theme) => theme === chosen) ?? "system";
}

export const settings = new Settings();
