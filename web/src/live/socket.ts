/**
 * The connection to `/v1/live`: retried for ever, resumed where it was lost. What it told is old when nothing proves
 * that the last message left the gateway less than 4 s ago. Without any message for 10 s it counts as lost. The
 * clock, the timers and the WebSocket come from outside, for tests.
 *
 * Two things prove when a message left the gateway at the earliest: the page asked for the connection before, and the
 * time in `alive`, with `late.ts`. Messages keep their order, so what follows left later. A message proves nothing of the
 * robots that it does not tell of: after a connection was lost, what was told before counts as of now only once all
 * robots had their turn over the next one, and `alive` says how long ago that was.
 */
import type { LiveSent } from "../api/types.ts";
import { decode } from "./decode.ts";
import type { Many } from "./pack.ts";

/** After so long without a message the gateway is lost, in milliseconds. It sends one every 2 s. */
export const SILENCE = 10_000;
/**
 * When no message is proved to have left the gateway within this time, values are not taken for those of now, in
 * milliseconds. `alive` comes every 2 s, and the proof may be 1 s too early.
 */
export const QUIET = 4_000;
const FIRST_WAIT = 500;
const LONGEST_WAIT = 5_000;
const LOOK = 250;

/** What the page uses of a WebSocket. A message is a text, or several that were read already. */
export interface Socket {
  addEventListener(kind: "message", act: (event: { data: unknown }) => void): void;
  addEventListener(kind: "close", act: (event: { code: number }) => void): void;
  close(): void;
}

export interface World {
  open(path: string): Socket;
  now(): number;
  /** Calls `act` once after so many milliseconds. Returns what cancels it. */
  after(ms: number, act: () => void): () => void;
  /** When a message with this time of the gateway left it at the earliest, on the page's clock; `null` if not known. */
  left(time: number, now: number): number | null;
  /** Whether the gateway still knows the session; `null` if it does not answer. */
  isSignedIn(): Promise<boolean | null>;
}

export interface Reader {
  /** `at`: when the message came; when it left the gateway at the earliest, if that is over 4 s ago. */
  message(sent: LiveSent | Many, at: number): void;
  /**
   * `heard`: of when is what was told last, if the gateway is lost; `null` if it is there. `isSilent`: the connection did
   * not end, and nothing comes over it.
   */
  state(heard: number | null, isSilent: boolean): void;
  /**
   * `heard`: of when is what was told last, if that is over 4 s ago; `null` if it is not. `isSlow`: messages come,
   * but late.
   */
  quiet(heard: number | null, isSlow: boolean): void;
  signedOut(): void;
  resume(): string | null;
  forgetResume(): void;
}

export class Link {
  private socket: Socket | null = null;
  /** When the last message left the gateway at the earliest. */
  private heard: number;
  /** When it came. */
  private spoke: number;
  private openedAt = 0;
  /** `null` before the first message, or the first connection that failed. */
  private isLive: boolean | null = null;
  private isQuiet = false;
  /** Whether something was told over any connection. */
  private hasTold = false;
  /** Whether something was told over an earlier connection that may have changed since: not all robots had their turn. */
  private isUnpassed = false;
  /** Whether the last connection that was lost did not end. */
  private isSilent = false;
  private wait = FIRST_WAIT;
  private cancel: () => void = () => {};
  private cancelLook: () => void = () => {};
  private isOver = false;

  constructor(
    private readonly world: World,
    private readonly reader: Reader,
  ) {
    this.heard = this.spoke = world.now();
  }

  /** Of when is what was told last, if that is over 4 s ago now; else `null`. The timers may not have looked yet. */
  old(): number | null {
    return this.world.now() - this.heard < QUIET ? null : this.heard;
  }

  /** The page's clock stood still for so long, in milliseconds. */
  slept(ms: number): void {
    this.heard -= ms;
    this.judge(this.world.now());
  }

  start(): void {
    this.connect();
    this.look();
  }

  /** Ends the connection for good. */
  end(): void {
    this.isOver = true;
    this.cancel();
    this.cancelLook();
    this.drop();
  }

  /** Tries at once: the page became visible, or the network came back. */
  hurry(): void {
    if (this.isOver || this.socket !== null) return;
    this.wait = FIRST_WAIT;
    this.cancel();
    this.connect();
  }

  /** Connects anew, and begins anew with all robots: something was missed. */
  again(): void {
    if (this.isOver) return;
    this.reader.forgetResume();
    this.cancel();
    this.drop();
    this.connect();
  }

  private connect(): void {
    if (this.isOver || this.socket !== null) return;
    const query = new URLSearchParams({ events: "true", alive: "true" });
    const resume = this.reader.resume();
    if (resume !== null) query.set("resume", resume);
    // Without a place to go on at, the gateway tells of all robots that are there, and not that it does so.
    else if (this.hasTold) this.reader.message({ type: "reset", robot: null }, this.heard);
    this.isUnpassed = this.hasTold;
    const socket = this.world.open(`/v1/live?${query}`);
    this.openedAt = this.world.now();
    let hasSpoken = false;
    this.socket = socket;
    socket.addEventListener("message", (event) => {
      if (this.socket !== socket) return;
      const now = this.world.now();
      this.spoke = now;
      this.wait = FIRST_WAIT;
      // The gateway spoke over this connection after the page asked for it.
      this.judge(now, hasSpoken || this.isUnpassed ? null : this.openedAt);
      hasSpoken = this.hasTold = true;
      if (this.isLive !== true) {
        this.isLive = true;
        this.reader.state(null, false);
      }
      for (const sent of read(event.data)) {
        if (sent.type === "alive") this.alive(sent, now);
        this.reader.message(sent, this.isQuiet ? Math.max(this.heard, this.openedAt) : now);
        // It made the page connect anew: what else this connection says is not of the new one.
        if (this.socket !== socket) return;
        if (this.isUnpassed && typeof sent.resume === "string") this.passed(now, this.openedAt);
      }
    });
    socket.addEventListener("close", ({ code }) => {
      if (this.socket !== socket) return;
      this.socket = null;
      this.lost(false);
      // 1008: the session or the token has ended.
      if (code === 1008) {
        this.isOver = true;
        this.reader.signedOut();
      } else if (hasSpoken) {
        this.retry();
      } else {
        void this.ask();
      }
    });
  }

  /** A page does not get to know why a WebSocket was refused, so it asks. */
  private async ask(): Promise<void> {
    const isSignedIn = await this.world.isSignedIn();
    if (this.isOver) return;
    if (isSignedIn === false) {
      this.isOver = true;
      this.reader.signedOut();
      return;
    }
    // The gateway is there and refused: the place to go on at may be wrong.
    if (isSignedIn === true) this.reader.forgetResume();
    this.retry();
  }

  /** `passed_ms_ago` is missing in what an older gateway says, and `null` before all robots had their turn. */
  private alive({ time, passed_ms_ago: ago }: Extract<LiveSent, { type: "alive" }>, now: number): void {
    const left = this.world.left(Date.parse(time), now);
    if (ago === null) return;
    if (this.isUnpassed) {
      if (ago !== undefined) this.passed(now, this.openedAt);
      else return;
    }
    if (left !== null) this.judge(now, left - (ago ?? 0));
  }

  /** All robots had their turn over this connection, in messages that left at this time at the earliest. */
  private passed(now: number, left: number): void {
    this.isUnpassed = false;
    this.judge(now, left);
  }

  private retry(): void {
    this.cancel();
    this.cancel = this.world.after(this.wait, () => this.connect());
    this.wait = Math.min(this.wait * 2, LONGEST_WAIT);
  }

  private lost(isSilent: boolean): void {
    if (this.isLive === false && this.isSilent === isSilent) return;
    this.isLive = false;
    this.isSilent = isSilent;
    this.reader.state(this.heard, isSilent);
  }

  private drop(): void {
    const socket = this.socket;
    this.socket = null;
    socket?.close();
  }

  /** Whether what was told is old. `left`: when a message left the gateway at the earliest. */
  private judge(now: number, left: number | null = null): void {
    this.heard = Math.max(this.heard, left ?? -Infinity);
    const isOld = now - this.heard >= QUIET;
    if (isOld || this.isQuiet) this.reader.quiet(isOld ? this.heard : null, isOld && now - this.spoke < QUIET);
    this.isQuiet = isOld;
  }

  private look(): void {
    this.cancelLook = this.world.after(LOOK, () => {
      const now = this.world.now();
      this.judge(now);
      if (this.socket !== null && now - Math.max(this.spoke, this.openedAt) > SILENCE) {
        this.drop();
        this.lost(true);
        this.retry();
      }
      this.look();
    });
  }
}

/** The messages of an event. */
function read(data: unknown): (LiveSent | Many)[] {
  if (Array.isArray(data)) return data;
  const sent = typeof data === "string" ? decode(data) : null;
  return sent === null ? [] : [sent];
}
