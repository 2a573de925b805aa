/**
 * The program on the page: its text, its history, its draft, what the gateway says of it, and how it is
 * stored.
 */
import { call } from "../../api/client.ts";
import type { ProgramChecked, ProgramVersion, StoredProgram } from "../../api/types.ts";
import { session } from "../../state/session.svelte.ts";
import type { Command } from "../../teach/commands.ts";
import { type Document, EMPTY, type Point, pointsOf, read, write } from "../../teach/document.ts";
import { Drafted } from "../../teach/draft.ts";
import { type History, type Selection, change, choose, historyOf, redo, undo } from "../../teach/history.ts";
import { standsAt } from "../../teach/propose.ts";
import type { Wrong } from "../../teach/toml.ts";
import { type Failure, failureOf } from "../../api/failure.ts";
import { shelf } from "./shelf.ts";

/** A text is checked when it has not changed for this time, in milliseconds. */
const REST = 300;
/** How long a check that had no answer waits to be sent again. */
const AGAIN = 2_000;

export interface Base {
  version: number;
  etag: string;
}

export type Phase = "loading" | "ready" | "failed";

/** What became of saving: it is told until the next change. */
export type Saved =
  | { kind: "saving" }
  | { kind: "saved"; version: number }
  | { kind: "refused"; failure: Failure }
  | { kind: "unknown" };

export class Editor {
  phase = $state<Phase>("loading");
  /** Why it could not be read from the gateway. */
  problem = $state.raw<Failure | null>(null);
  history = $state.raw<History>(historyOf(EMPTY));
  /**
   * A text that the page does not take apart: it is shown as it is, and checked, planned and run all the
   * same.
   */
  raw = $state<string | null>(null);
  wrong = $state.raw<Wrong | null>(null);
  /** The version that the text began from; `null` if nothing was stored. */
  base = $state.raw<Base | null>(null);
  /** The text of that version. */
  stored = $state("");
  /** When the draft was made that the page began with; `null` without one. */
  draftOf = $state<number | null>(null);
  /** Whether the draft is kept in this browser. */
  isKept = $state(true);
  /** Whether another page of this browser keeps another draft of this program: this one is not kept then. */
  isOthers = $state(false);
  saved = $state.raw<Saved | null>(null);
  /** The version that another one saved meanwhile: it is compared, and one is chosen. */
  conflict = $state.raw<StoredProgram | null>(null);
  check = $state.raw<{ text: string; checked: ProgramChecked } | null>(null);
  /** Why the last check failed. */
  checkProblem = $state.raw<Failure | null>(null);
  readonly text = $derived(this.raw ?? write(this.history.document));
  readonly isDirty = $derived(this.base === null || this.text !== this.stored);
  /** What the gateway says of the present text; `null` until it is there. */
  readonly checked = $derived(this.check?.text === this.text ? this.check.checked : null);
  /** Fields with a text that is no value: by step and key. It stands in the page alone. */
  unread = $state.raw<ReadonlySet<string>>(new Set());
  /** Grows with each change that did not come from an input: inputs are made anew then, with the values of now. */
  epoch = $state(0);
  #timer: ReturnType<typeof setTimeout> | null = null;
  #isChecking = false;
  #isOver = false;
  /** Whether the text that is not taken apart took the place of a program, which undo brings back. */
  #isOverProgram = false;

  readonly #draft: Drafted;

  constructor(readonly name: string) {
    this.#draft = new Drafted(shelf, name);
    globalThis.addEventListener?.("storage", this.#look);
    void this.load();
  }

  /** Another page of this browser kept a draft. */
  readonly #look = (event: StorageEvent): void => {
    if (this.phase === "ready" && this.#draft.isOf(event)) this.isOthers = this.#draft.isOthers(this.text);
  };

  /** Keeps this draft in the place of the one of another page. */
  keepThis(): void {
    this.#keep(true);
  }

  end(): void {
    globalThis.removeEventListener?.("storage", this.#look);
    this.#isOver = true;
    if (this.#timer !== null) clearTimeout(this.#timer);
  }

  get document(): Document {
    return this.raw === null ? this.history.document : EMPTY;
  }

  get selection(): Selection {
    return this.history.selection;
  }

  /** The chosen point, or the one that the arm stands at when the chosen step is carried out; `null` without one. */
  get point(): Point | null {
    const { selection } = this;
    if (selection === null || this.raw !== null) return null;
    if ("step" in selection) return standsAt(this.document, selection.step);
    return pointsOf(this.document).find(({ name }) => name === selection.point) ?? null;
  }

  get #path(): string {
    return `/v1/programs/${encodeURIComponent(this.name)}`;
  }

  /** Reads the latest version. A draft that differs from it is shown in its place. */
  async load(): Promise<void> {
    this.phase = "loading";
    const answer = await call<StoredProgram>("GET", this.#path);
    if (this.#isOver) return;
    const draft = this.#draft.read();
    if (answer.kind === "ok") {
      const latest = answer.value;
      if (draft !== null && draft.text !== latest.program) {
        this.#begin(draft.text, draft.base, draft.base?.etag === latest.etag ? latest.program : "");
        this.draftOf = draft.at;
        if (draft.base?.etag !== latest.etag) this.conflict = latest;
      } else {
        this.#begin(latest.program, latest, latest.program);
      }
    } else if (answer.kind === "refused" && answer.problem.code === "no_such_program") {
      this.#begin(draft?.text ?? "", null, "");
      this.draftOf = draft?.at ?? null;
    } else if (draft !== null) {
      // Without the gateway, the draft is still there to work on.
      this.#begin(draft.text, draft.base, "");
      this.draftOf = draft.at;
      this.problem = failureOf(answer);
    } else {
      this.problem = failureOf(answer);
      this.phase = "failed";
    }
  }

  #begin(text: string, base: Base | null, stored: string): void {
    this.problem = null;
    this.#isOverProgram = false;
    this.base = base === null ? null : { version: base.version, etag: base.etag };
    this.stored = stored;
    this.#take(text, null);
    this.phase = "ready";
    this.#checkSoon(0);
  }

  /** Takes a text apart, as a change of what is there if there is something. */
  #take(text: string, over: History | null): void {
    const result = read(text);
    if ("ok" in result) {
      this.history =
        over === null
          ? historyOf(result.ok)
          : change(over, { kind: "replace", document: result.ok }, result.ok.steps.length > 0 ? { step: 0 } : null);
      this.raw = null;
      this.wrong = null;
      this.#isOverProgram = false;
    } else {
      this.#isOverProgram ||= over !== null;
      this.raw = text;
      this.wrong = result.wrong;
    }
    this.#anew();
  }

  change(command: Command, after: Selection = this.selection): void {
    this.history = change(this.history, command, after);
    this.#anew();
    this.#changed();
  }

  /** A change by an input, which keeps the focus; so do texts in other inputs that are no values. */
  type(command: Command, after: Selection = this.selection): void {
    this.history = change(this.history, command, after);
    this.#changed();
  }

  #anew(): void {
    this.unread = new Set();
    this.epoch += 1;
  }

  choose(selection: Selection): void {
    this.history = choose(this.history, selection);
  }

  get canUndo(): boolean {
    return this.raw === null ? this.history.done.length > 0 : this.#isOverProgram;
  }

  get canRedo(): boolean {
    return this.raw === null && this.history.undone.length > 0;
  }

  undo(): void {
    if (!this.canUndo) return;
    if (this.raw === null) this.history = undo(this.history);
    this.raw = null;
    this.wrong = null;
    this.#isOverProgram = false;
    this.#anew();
    this.#changed();
  }

  redo(): void {
    if (!this.canRedo) return;
    this.history = redo(this.history);
    this.#anew();
    this.#changed();
  }

  /** Puts another text in the place of this one: a version, a file, or what a person wrote. */
  replace(text: string): void {
    this.#take(text, this.raw === null || this.#isOverProgram ? this.history : null);
    this.#changed();
  }

  /** Goes back to what is stored. This can be undone. */
  discard(): void {
    this.replace(this.stored);
    this.draftOf = null;
  }

  setUnread(key: string, isUnread: boolean): void {
    if (this.unread.has(key) === isUnread) return;
    const next = new Set(this.unread);
    if (isUnread) next.add(key);
    else next.delete(key);
    this.unread = next;
  }

  /** The inputs of a step are gone, and what was typed into them too. */
  forgetUnread(step: number): void {
    if (this.unread.size > 0) this.unread = new Set([...this.unread].filter((key) => !key.startsWith(`${step} `)));
  }

  #changed(): void {
    this.saved = null;
    if (this.isDirty) this.#keep(false);
    else this.#dropDraft();
    this.#checkSoon(REST);
  }

  #keep(isOver: boolean): void {
    const isKept = this.#draft.keep({ text: this.text, base: this.base, at: Date.now() }, isOver);
    this.isOthers = !isKept && this.#draft.isOthers(this.text);
    this.isKept = isKept || this.isOthers;
  }

  #dropDraft(): void {
    this.#draft.drop(this.text);
    this.draftOf = null;
    this.isKept = true;
    this.isOthers = false;
  }

  #checkSoon(after: number): void {
    if (this.#timer !== null) clearTimeout(this.#timer);
    this.#timer = setTimeout(() => void this.#ask(), after);
  }

  async #ask(): Promise<void> {
    const { text } = this;
    if (this.#isChecking || this.check?.text === text) return;
    // Without a step there is nothing to check: the page says so in its own words.
    if (text.trim() === "" || (this.raw === null && this.document.steps.length === 0)) {
      this.check = null;
      this.checkProblem = null;
      return;
    }
    this.#isChecking = true;
    const body = { program: text };
    const answer = await call<ProgramChecked>("POST", "/v1/programs/check", { body, csrf: session.csrf });
    this.#isChecking = false;
    if (this.#isOver) return;
    if (answer.kind === "ok") {
      this.check = { text, checked: answer.value };
      this.checkProblem = null;
      if (this.text !== text) this.#checkSoon(0);
    } else {
      this.checkProblem = failureOf(answer);
      this.#checkSoon(AGAIN);
    }
  }

  /** Stores the text as a new version, over the version that it began from. */
  async save(over: Base | null = this.base): Promise<void> {
    const { text } = this;
    this.saved = { kind: "saving" };
    const headers: Record<string, string> = over === null ? { "If-None-Match": "*" } : { "If-Match": over.etag };
    const answer = await call<ProgramVersion>("PUT", this.#path, { body: { program: text }, csrf: session.csrf, headers });
    if (this.#isOver) return;
    if (answer.kind === "ok") {
      this.base = { version: answer.value.version, etag: answer.value.etag };
      this.stored = text;
      this.conflict = null;
      this.saved = { kind: "saved", version: answer.value.version };
      if (this.text === text) this.#dropDraft();
      else this.#changed();
    } else if (answer.kind === "refused" && answer.problem.code === "not_this_version") {
      this.saved = { kind: "refused", failure: failureOf(answer) };
      await this.#readOther();
    } else if (answer.kind === "refused" && answer.status < 500) {
      this.saved = { kind: "refused", failure: failureOf(answer) };
    } else {
      this.saved = { kind: "unknown" };
    }
  }

  /** Reads what another one saved. If the program was removed, it is stored anew. */
  async #readOther(): Promise<void> {
    const answer = await call<StoredProgram>("GET", this.#path);
    if (this.#isOver) return;
    if (answer.kind === "ok") {
      this.conflict = answer.value;
    } else if (answer.kind === "refused" && answer.problem.code === "no_such_program") {
      this.base = null;
      this.stored = "";
    }
  }

  /** Takes the version of the other one. What was here can be had back with undo. */
  takeTheirs(): void {
    const { conflict } = this;
    if (conflict === null) return;
    this.base = { version: conflict.version, etag: conflict.etag };
    this.stored = conflict.program;
    this.conflict = null;
    this.replace(conflict.program);
  }

  /** Goes on with what is here, over the version of the other one: saving makes the next version. */
  keepMine(): void {
    const { conflict } = this;
    if (conflict === null) return;
    this.base = { version: conflict.version, etag: conflict.etag };
    this.stored = conflict.program;
    this.conflict = null;
    this.#changed();
  }

  /** Removes the program with its versions. The text stays here as a draft. */
  async remove(): Promise<Failure | null> {
    if (this.base === null) return null;
    const headers = { "If-Match": this.base.etag };
    const answer = await call("DELETE", this.#path, { csrf: session.csrf, headers });
    if (this.#isOver) return null;
    if (answer.kind === "ok") {
      this.base = null;
      this.stored = "";
      this.#changed();
      return null;
    }
    if (answer.kind === "refused" && answer.problem.code === "not_this_version") await this.#readOther();
    return failureOf(answer);
  }
}
