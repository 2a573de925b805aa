/** Who uses the page, and for how long. */
import { call } from "../api/client.ts";
import { tokenOf } from "../api/secret.ts";
import type { Session } from "../api/types.ts";

/** How often a page that somebody uses tells the gateway so: a session ends 15 minutes after its last request. */
const TELL = 60_000;
/** For so long after the last touch somebody counts as present. */
export const PRESENT = 5 * 60_000;

class SessionState {
  phase = $state<"starting" | "out" | "in">("starting");
  session = $state.raw<Session | null>(null);
  /** Why the page asks to sign in; a code, or `ended` or `bad_link`. */
  problem = $state<{ code: string; message: string } | null>(null);
  #used = performance.now();
  #told = performance.now();

  get csrf(): string | null {
    return this.session?.csrf ?? null;
  }

  /** Whether somebody used the page lately. */
  get isUsed(): boolean {
    return performance.now() - this.#used < PRESENT;
  }

  /** How long somebody still counts as present, in milliseconds. */
  get presentFor(): number {
    return Math.max(0, PRESENT - (performance.now() - this.#used));
  }

  may(robot: string): boolean {
    const { session } = this;
    if (session === null || session.role === "viewer") return false;
    return session.robot === null || session.robot === robot;
  }

  /** Takes the secret out of the address, signs in with it, or finds the session that is open. */
  async begin(): Promise<void> {
    const secret = location.hash.slice(1);
    if (secret !== "") history.replaceState(null, "", location.pathname + location.search);
    const token = tokenOf(secret);
    if (token !== null && (await this.signIn({ token }))) return;
    if (secret !== "" && token === null) this.problem = { code: "bad_link", message: "" };
    const known = await call<Session>("GET", "/v1/session");
    if (known.kind === "ok") this.#enter(known.value);
    else {
      this.phase = "out";
      if (known.kind === "unknown") this.problem = { code: "unknown", message: "" };
    }
  }

  /** Returns whether it worked. */
  async signIn(by: { token: string } | { name: string; password: string }): Promise<boolean> {
    const path = "token" in by ? "/v1/session/token" : "/v1/session";
    const answer = await call<Session>("POST", path, { body: by });
    if (answer.kind === "ok") {
      this.#enter(answer.value);
      return true;
    }
    this.problem = answer.kind === "refused" ? answer.problem : { code: "unknown", message: "" };
    return false;
  }

  async signOut(): Promise<void> {
    await call("DELETE", "/v1/session", { csrf: this.csrf });
    this.session = null;
    this.problem = null;
    this.phase = "out";
  }

  /** The gateway does not know the session any more. */
  ended(): void {
    if (this.phase !== "in") return;
    this.session = null;
    this.problem = { code: "ended", message: "" };
    this.phase = "out";
  }

  /** Somebody touched the page. */
  use(): void {
    this.#used = performance.now();
    if (this.phase !== "in" || this.#used - this.#told < TELL) return;
    this.#told = this.#used;
    void call<Session>("GET", "/v1/session").then((answer) => {
      if (answer.kind === "refused" && answer.status === 401) this.ended();
    });
  }

  #enter(session: Session): void {
    this.session = session;
    this.problem = null;
    this.phase = "in";
    this.#used = this.#told = performance.now();
  }
}

export const session = new SessionState();
