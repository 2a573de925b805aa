/**
 * A clock for a page that goes with the messages of the gateway: each sign of life is two seconds. A day of timers
 * then passes in as much time as its messages take. Between messages it goes as clocks do. The page reads each message
 * by itself, because a worker has a clock of its own. It runs in the page, before its scripts.
 */
export function goWithMessages(): void {
  const STEP = 2_000;
  Reflect.deleteProperty(window, "Worker");
  const real = { now: performance.now.bind(performance), later: window.setTimeout.bind(window), each: window.setInterval.bind(window) };
  const timers = new Map<number, { due: number; every: number | null; act: () => void }>();
  let now = real.now();
  let shown = real.now();
  let last = 1_000_000;

  /** Lets time pass, with each timer at its time. */
  function pass(ms: number): void {
    const end = now + ms;
    for (;;) {
      let next: number | null = null;
      for (const [id, { due }] of timers) if (due <= end && (next === null || due < (timers.get(next)?.due ?? Infinity))) next = id;
      const timer = next === null ? undefined : timers.get(next);
      if (next === null || timer === undefined) break;
      now = Math.max(now, timer.due);
      if (timer.every === null) timers.delete(next);
      else timer.due = now + Math.max(timer.every, 1);
      timer.act();
    }
    now = end;
  }

  function start(every: boolean): (act: unknown, ms?: number, ...more: unknown[]) => number {
    return (act, ms = 0, ...more) => {
      last += 1;
      timers.set(last, { due: now + ms, every: every ? ms : null, act: () => (act as (...of: unknown[]) => void)(...more) });
      return last;
    };
  }

  const stop = (id?: number): void => void timers.delete(id ?? 0);
  Object.assign(window, { setTimeout: start(false), setInterval: start(true) });
  Object.assign(window, { clearTimeout: stop, clearInterval: stop });
  performance.now = () => now;
  // The time of day goes with it: the page takes a clock that stood still for a computer that slept.
  const apart = Date.now() - real.now();
  Date.now = () => now + apart;
  real.each(() => {
    const at = real.now();
    pass(at - shown);
    shown = at;
  }, 20);

  const listen = WebSocket.prototype.addEventListener;
  WebSocket.prototype.addEventListener = function (this: WebSocket, kind: string, act: EventListenerOrEventListenerObject): void {
    listen.call(this, kind, (event: Event) => {
      if (event instanceof MessageEvent && String(event.data).startsWith('{"type":"alive"')) pass(STEP);
      (act as EventListener)(event);
    });
  } as typeof WebSocket.prototype.addEventListener;
}
