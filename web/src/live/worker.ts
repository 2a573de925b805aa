/**
 * Reads the stream in a thread of its own, and hands it on in packs: see `pack.ts`. The page tells it `Order`s, and it
 * tells `News`. A pack leaves when the page has taken the one before.
 */
import { Packer, type Pack } from "./pack.ts";

export type Order = { kind: "open"; number: number; url: string } | { kind: "taken" } | { kind: "close" };
/** `number`: of the connection. */
export type News = { number: number } & ({ kind: "pack"; pack: Pack } | { kind: "closed"; code: number });

/** The shortest time between two packs, in milliseconds: two frames of a screen. Each of them costs the page some work. */
const PACE = 30;
/** As a gateway ends the connection of a reader that does not read. */
const TOO_SLOW = 1013;

let end: () => void = () => {};
let taken: () => void = () => {};

function open(number: number, url: string): void {
  end();
  const socket = new WebSocket(url);
  const packer = new Packer();
  const say = (news: News): void => postMessage(news);
  let isTaken = true;
  let timer: ReturnType<typeof setTimeout> | null = null;
  let last = -Infinity;
  const hand = (): void => {
    timer = null;
    if (!isTaken || packer.isEmpty) return;
    last = performance.now();
    isTaken = false;
    say({ number, kind: "pack", pack: packer.take(last) });
  };
  const plan = (): void => {
    if (isTaken && !packer.isEmpty) timer ??= setTimeout(hand, Math.max(0, last + PACE - performance.now()));
  };
  const over = (code: number): void => {
    end();
    say({ number, kind: "closed", code });
  };
  end = () => {
    end = taken = () => {};
    if (timer !== null) clearTimeout(timer);
    socket.onmessage = socket.onclose = null;
    socket.close();
  };
  taken = () => {
    isTaken = true;
    plan();
  };
  socket.onmessage = ({ data }) => {
    if (typeof data === "string") packer.add(data, performance.now());
    if (packer.isFull) over(TOO_SLOW);
    else plan();
  };
  socket.onclose = ({ code }) => {
    // What came before the end counts.
    for (isTaken = true; !packer.isEmpty; isTaken = true) hand();
    over(code);
  };
}

addEventListener("message", ({ data }: MessageEvent<Order>) => {
  if (data.kind === "open") open(data.number, data.url);
  else if (data.kind === "taken") taken();
  else end();
});
