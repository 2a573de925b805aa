/** A WebSocket whose messages are read by a worker. One worker reads for the page, one connection at a time. */
import { Unpacker } from "./pack.ts";
import type { Socket } from "./socket.ts";
import type { News, Order } from "./worker.ts";

let worker: Worker | null | undefined;
let connections = 0;

/** The worker; `null` where there is none. It stays for as long as the page. */
function reader(): Worker | null {
  if (worker !== undefined) return worker;
  try {
    worker = new Worker(new URL("./worker.ts", import.meta.url), { type: "module" });
  } catch {
    worker = null;
  }
  return worker;
}

/** Connects. Without a worker, the page reads each message by itself. */
export function connect(url: string): Socket {
  const of = reader();
  return of === null ? new WebSocket(url) : new Remote(of, url);
}

class Remote implements Socket {
  private readonly number = (connections += 1);
  private readonly unpacker = new Unpacker();
  private told: (event: { data: unknown }) => void = () => {};
  private ended: (event: { code: number }) => void = () => {};

  constructor(
    private readonly of: Worker,
    url: string,
  ) {
    of.addEventListener("message", this.take);
    of.addEventListener("error", this.failed);
    this.order({ kind: "open", number: this.number, url });
  }

  addEventListener(kind: "message", act: (event: { data: unknown }) => void): void;
  addEventListener(kind: "close", act: (event: { code: number }) => void): void;
  addEventListener(kind: "message" | "close", act: (event: never) => void): void {
    if (kind === "message") this.told = act as typeof this.told;
    else this.ended = act as typeof this.ended;
  }

  close(): void {
    this.leave();
    this.order({ kind: "close" });
  }

  private readonly take = ({ data }: MessageEvent<News>): void => {
    if (data.number !== this.number) return;
    if (data.kind === "closed") {
      this.leave();
      this.ended({ code: data.code });
      return;
    }
    this.told({ data: this.unpacker.take(data.pack) });
    this.order({ kind: "taken" });
  };

  /** The worker could not be loaded, or made a mistake: from the next connection on the page reads by itself. */
  private readonly failed = (): void => {
    this.leave();
    this.of.terminate();
    worker = null;
    this.ended({ code: 1006 });
  };

  private leave(): void {
    this.of.removeEventListener("message", this.take);
    this.of.removeEventListener("error", this.failed);
  }

  private order(order: Order): void {
    this.of.postMessage(order);
  }
}
