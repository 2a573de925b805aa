/** Who uses the page, and for how long. */
import { call, whenSignedOut } from "../api/client.ts";
import { type OneTimeLink, type Secret, oneTimeLinkOf, secretOf } from "../api/secret.ts";
import type { Role, Session } from "../api/types.ts";
import { mayBeOpen, opened } from "./known.ts";
import { highest, isAtLeast, roleFor } from "./rights.ts";

/** How often a page that somebody uses tells the gateway so: a session ends 15 minutes after its last request. */
const TELL = 60_000;
/** For so long after the last touch somebody counts as present. */
export const PRESENT = 5 * 60_000;

/** A link that signs in was opened while a session is open. */
export interface Offer {
  known: Session;
  /** Who the link signs in; `null` if it is not valid, or that cannot be asked. */
  offered: Session | null;
  by: Secret;
}

class SessionState {
  phase = $state<"starting" | "asking" | "link" | "out" | "in">("starting");
  link = $state.raw<OneTimeLink | null>(null);
  /** Who set a password with a one-time link just now: the page asks this user to sign in. */
  welcome = $state<string | null>(null);
  offer = $state.raw<Offer | null>(null);
  /** Whether somebody signed out, and the gateway did not say that the session has ended. */
  isMaybeOpen = $state(false);
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

  /** The role for this robot, or for all robots alike (`null`); `null` if there is none. */
  roleFor(robot: string | null): Role | null {
    const { session } = this;
    return session === null ? null : roleFor(session.role, session.robot, robot);
  }

  may(robot: string): boolean {
    return this.has("operator", robot);
  }

  /** Whether the role is this one or a higher one, for this robot; `null` is all robots alike. */
  has(role: Role, robot: string | null): boolean {
    const own = this.roleFor(robot);
    return own !== null && isAtLeast(own, role);
  }

  /** Whether the role is this one or a higher one, for one robot at least. */
  hasSomewhere(role: Role): boolean {
    const { session } = this;
    return session !== null && isAtLeast(highest(session.role, session.robot), role);
  }

  /** Takes the secret out of the address, signs in with it, or finds the session that is open. */
  async begin(): Promise<void> {
    const secret = location.hash.slice(1);
    if (secret !== "") history.replaceState(null, "", location.pathname + location.search);
    this.link = oneTimeLinkOf(secret);
    if (this.link !== null) {
      this.phase = "link";
      return;
    }
    const by = secretOf(secret);
    const known = this.phase === "in" || mayBeOpen() ? await call<Session>("GET", "/v1/session") : null;
    if (known?.kind === "ok") {
      if (by === null) this.#enter(known.value);
      else await this.#ask(known.value, by);
      return;
    }
    if (known?.kind === "refused" && known.status === 401) opened(false);
    // A session that is open stays: without an answer it is not known to have ended.
    else if (known !== null && this.phase === "in") return;
    if (known?.kind !== "unknown" && by !== null && (await this.signIn(by))) return;
    this.phase = "out";
    if (known?.kind === "unknown") this.problem = { code: "unknown", message: "" };
    else if (secret !== "" && by === null) this.problem = { code: "bad_link", message: "" };
  }

  /** A link was opened in the tab of this page: only the text behind `#` is another one. Another text changes nothing. */
  async follow(): Promise<void> {
    const secret = location.hash.slice(1);
    if (secret === "") return;
    const isLink = oneTimeLinkOf(secret) !== null || secretOf(secret) !== null;
    if (isLink || this.phase === "out") await this.begin();
    else history.replaceState(null, "", location.pathname + location.search);
  }

  /** The one-time link was used, or is left. A session that is open in this browser goes on, unless it was of this user. */
  async leaveLink(welcome: string | null): Promise<void> {
    this.link = null;
    this.welcome = welcome;
    await this.begin();
  }

  /** Goes on with the session that is open. */
  keep(): void {
    if (this.offer !== null) this.#enter(this.offer.known);
  }

  /** Ends the session that is open, and signs in with the link. */
  async replace(): Promise<void> {
    const { offer } = this;
    if (offer === null) return;
    this.isMaybeOpen = !(await this.#close(offer.known.csrf));
    if (this.isMaybeOpen || this.offer !== offer) return;
    this.offer = null;
    if (!(await this.signIn(offer.by))) this.phase = "out";
  }

  /** Returns whether it worked. */
  async signIn(by: Secret | { name: string; password: string }): Promise<boolean> {
    const path = "token" in by ? "/v1/session/token" : "secret" in by ? "/v1/session/link" : "/v1/session";
    const answer = await call<Session>("POST", path, { body: by });
    if (answer.kind === "ok") {
      this.#enter(answer.value);
      return true;
    }
    this.problem = answer.kind === "refused" ? answer.problem : { code: "unknown", message: "" };
    return false;
  }

  async signOut(): Promise<void> {
    this.isMaybeOpen = false;
    const isClosed = await this.#close(this.csrf);
    if (this.phase !== "in") return;
    if (!isClosed) {
      this.isMaybeOpen = true;
      return;
    }
    opened(false);
    this.session = null;
    this.problem = null;
    this.phase = "out";
  }

  /** The gateway does not know the session any more. */
  ended(): void {
    if (this.phase !== "in") return;
    opened(false);
    this.session = null;
    this.problem = { code: "ended", message: "" };
    this.phase = "out";
  }

  /** Somebody touched the page. */
  use(): void {
    this.#used = performance.now();
    if (this.phase !== "in" || this.#used - this.#told < TELL) return;
    this.#told = this.#used;
    void this.#look();
  }

  /** The role may be another one by now. */
  async #look(): Promise<void> {
    const { session } = this;
    const answer = await call<Session>("GET", "/v1/session");
    if (answer.kind !== "ok" || this.phase !== "in" || this.session !== session || session === null) return;
    // Another tab may have signed somebody else in: what is shown here is not theirs.
    const isSame = answer.value.user === session.user && answer.value.token === session.token;
    if (isSame) this.session = answer.value;
  }

  /** Returns whether it is sure that the session has ended. */
  async #close(csrf: string | null): Promise<boolean> {
    const answer = await call("DELETE", "/v1/session", { csrf });
    return answer.kind === "ok" || (answer.kind === "refused" && answer.status === 401);
  }

  /** The link of the session that is open changes nothing. Of another one, the person decides. */
  async #ask(known: Session, by: Secret): Promise<void> {
    const answer =
      "token" in by
        ? await call<Session>("GET", "/v1/session", { bearer: by.token })
        : await call<Session>("POST", "/v1/session/link", { body: { ...by, look: true } });
    const offered = answer.kind === "ok" ? answer.value : null;
    if (offered !== null && offered.token !== null && offered.token === known.token) {
      this.#enter(known);
      return;
    }
    this.offer = { known, offered, by };
    this.phase = "asking";
  }

  #enter(session: Session): void {
    opened(true);
    this.session = session;
    this.offer = null;
    this.welcome = null;
    this.isMaybeOpen = false;
    this.problem = null;
    this.phase = "in";
    whenSignedOut(() => this.ended());
    this.#used = this.#told = performance.now();
  }
}

export const session = new SessionState();
