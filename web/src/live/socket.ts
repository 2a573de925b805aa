/**
 * The connection to `/v1/live`: retried for ever, resumed where it was lost. Without a sign of life for 4 s
 * what it told is old, and for 10 s it counts as lost. The clock, the timers and the WebSocket come from
 * outside, for tests.
 */
import type { LiveSent } from "../api/types.ts";
import { decode } from "./decode.ts";
import type { Many } from "./pack.ts";

/** After so long without a message the gateway is lost, in milliseconds. It sends one every 2 s. */
export const SILENCE = 10_000;
/** After so long without a message values are not taken for those of now, in milliseconds. */
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
  /** Whether the gateway still knows the session; `null` if it does not answer. */
  isSignedIn(): Promise<boolean | null>;
}

export interface Reader {
  message(sent: LiveSent | Many, now: number): void;
  /** `heard`: when the gateway was last heard, if it is lost; `null` if it is there. */
  state(heard: number | null): void;
  /** `heard`: when the gateway was last heard, if that is over 4 s ago; `null` once it is heard again. */
  quiet(heard: number | null): void;
  signedOut(): void;
  resume(): string | null;
  forgetResume(): void;
}

export class Link {
  private socket: Socket | null = null;
  private heard: number;
  private openedAt = 0;
  /** `null` before the first message, or the first connection that failed. */
  private isLive: boolean | null = null;
  private isQuiet = false;
  private wait = FIRST_WAIT;
  private cancel: () => void = () => {};
  private cancelLook: () => void = () => {};
  private isOver = false;

  constructor(
    private readonly world: World,
    private readonly reader: Reader,
  ) {
    this.heard = world.now();
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

  private connect(): void {
    if (this.isOver || this.socket !== null) return;
    const query = new URLSearchParams({ events: "true", alive: "true" });
    const resume = this.reader.resume();
    if (resume !== null) query.set("resume", resume);
    const socket = this.world.open(`/v1/live?${query}`);
    this.openedAt = this.world.now();
    let hasSpoken = false;
    this.socket = socket;
    socket.addEventListener("message", (event) => {
      if (this.socket !== socket) return;
      hasSpoken = true;
      this.heard = this.world.now();
      this.wait = FIRST_WAIT;
      if (this.isQuiet) {
        this.isQuiet = false;
        this.reader.quiet(null);
      }
      if (this.isLive !== true) {
        this.isLive = true;
        this.reader.state(null);
      }
      for (const sent of read(event.data)) this.reader.message(sent, this.heard);
    });
    socket.addEventListener("close", ({ code }) => {
      if (this.socket !== socket) return;
      this.socket = null;
      this.lost();
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

  private retry(): void {
    this.cancel();
    this.cancel = this.world.after(this.wait, () => this.connect());
    this.wait = Math.min(this.wait * 2, LONGEST_WAIT);
  }

  private lost(): void {
    if (this.isLive === false) return;
    this.isLive = false;
    this.reader.state(this.heard);
  }

  private drop(): void {
    const socket = this.socket;
    this.socket = null;
    socket?.close();
  }

  private look(): void {
    this.cancelLook = this.world.after(LOOK, () => {
      const now = this.world.now();
      if (!this.isQuiet && now - this.heard >= QUIET) {
        this.isQuiet = true;
        this.reader.quiet(this.heard);
      }
      if (this.socket !== null && now - Math.max(this.heard, this.openedAt) > SILENCE) {
        this.drop();
        this.lost();
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
