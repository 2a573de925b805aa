/** What a page costs its browser, from the trace of the browser and its counters. */
import type { Browser, Page } from "playwright-core";

/** Work of drawing: in the test the processor does what a graphics card does elsewhere. It does not count. */
const DRAWING = new Set(["PrePaint", "Paint", "PaintImage", "Layerize", "Commit", "UpdateLayer", "RasterTask", "CompositeLayers"]);
const CATEGORIES = ["devtools.timeline", "disabled-by-default-devtools.timeline"];

interface TraceEvent {
  name: string;
  ph: string;
  pid: number;
  tid: number;
  ts: number;
  dur?: number;
  tdur?: number;
  args?: { name?: string };
}

/** A task of the page's main thread: when it began, and the time of the processor without drawing, in milliseconds. */
export interface Task {
  at: number;
  busy: number;
}

export interface Trace {
  tasks: Task[];
  /** When the frames of the page began, in milliseconds. */
  frames: number[];
}

/** Records the main thread for as long as `act` takes. */
export async function traced(browser: Browser, page: Page, act: () => Promise<void>): Promise<Trace> {
  await browser.startTracing(page, { categories: CATEGORIES });
  await act();
  const { traceEvents } = JSON.parse((await browser.stopTracing()).toString()) as { traceEvents: TraceEvent[] };
  const mains = traceEvents.filter(({ name, args }) => name === "thread_name" && args?.name === "CrRendererMain");
  const isTask = ({ name, ph }: TraceEvent): boolean => name === "RunTask" && ph === "X";
  const all = mains.map(({ pid, tid }) => traceEvents.filter((event) => event.pid === pid && event.tid === tid));
  // The browser keeps a process ready that does nothing.
  const events = all.sort((a, b) => b.filter(isTask).length - a.filter(isTask).length)[0] ?? [];
  events.sort((a, b) => a.ts - b.ts || (b.dur ?? 0) - (a.dur ?? 0));
  const tasks: (Task & { end: number })[] = [];
  const frames: number[] = [];
  let drawn = -Infinity;
  for (const { name, ph, ts, dur = 0, tdur = dur } of events) {
    if (name === "FireAnimationFrame") frames.push(ts / 1_000);
    if (ph !== "X") continue;
    const last = tasks.at(-1);
    if (name === "RunTask") tasks.push({ at: ts / 1_000, busy: tdur / 1_000, end: ts + dur });
    else if (DRAWING.has(name) && last !== undefined && ts < last.end && ts >= drawn) {
      last.busy -= tdur / 1_000;
      drawn = ts + dur;
    }
  }
  return { tasks: tasks.map(({ at, busy }) => ({ at, busy })), frames };
}

/** The value below which this part of them is; 0 of none. */
export function part(values: number[], of: number): number {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[Math.min(sorted.length - 1, Math.floor(sorted.length * of))] ?? 0;
}

/** How long a frame of a usual screen is, in milliseconds. */
const FRAME = 1_000 / 60;

/** How busy the thread was in each sixtieth of a second, in milliseconds. */
export function perFrame({ tasks }: Trace): number[] {
  const first = tasks[0]?.at ?? 0;
  const count = Math.ceil(((tasks.at(-1)?.at ?? 0) - first) / FRAME);
  const frames = Array.from({ length: count }, () => 0);
  for (const { at, busy } of tasks) {
    const place = Math.min(count - 1, Math.floor((at - first) / FRAME));
    frames[place] = (frames[place] ?? 0) + busy;
  }
  return frames;
}

export interface Memory {
  /** Used by JavaScript after a collection, in MB. */
  heap: number;
  nodes: number;
  listeners: number;
}

/** Collects the garbage, and says what is left. */
export async function memory(page: Page): Promise<Memory> {
  const session = await page.context().newCDPSession(page);
  await session.send("Performance.enable");
  // What the first collection finalizes, the second one frees.
  await session.send("HeapProfiler.collectGarbage");
  await session.send("HeapProfiler.collectGarbage");
  const { metrics } = await session.send("Performance.getMetrics");
  const of = (name: string): number => metrics.find((metric) => metric.name === name)?.value ?? 0;
  await session.detach();
  return { heap: of("JSHeapUsedSize") / 1e6, nodes: of("Nodes"), listeners: of("JSEventListeners") };
}
