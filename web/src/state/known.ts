/**
 * Whether a session was opened in this browser, as far as the browser kept that. The cookie of a session cannot be
 * read by the page, and to ask the gateway without one is an error 401 in the console of the browser.
 */
export const SESSION_KEY = "r6-session";

/** `true` also if the browser keeps nothing: then only the gateway knows. */
export function mayBeOpen(): boolean {
  try {
    return localStorage.getItem(SESSION_KEY) !== null;
  } catch {
    return true;
  }
}

export function opened(isOpen: boolean): void {
  try {
    if (isOpen) localStorage.setItem(SESSION_KEY, "1");
    else localStorage.removeItem(SESSION_KEY);
  } catch {
    // The gateway is asked.
  }
}
