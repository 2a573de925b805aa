/**
 * Draws buckets with uPlot: a band from min to max, and a line of the means. Nothing is drawn across a gap.
 */
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { shownZone, wall } from "../i18n/zone.ts";
import { type Bucket, columns, extent } from "./buckets.ts";
import { lone } from "./lone.ts";

export interface Line {
  /** From 1 to 6: the token of the colour. */
  colour: number;
  isDashed: boolean;
  /** What is missing is `undefined`. */
  buckets: (Bucket | undefined)[];
}

export interface Drawing {
  /** The begin and the width of each bucket, in milliseconds. */
  times: { at: number; width: number }[];
  lines: Line[];
  from: number;
  to: number;
  zone: string;
}

const DAY = 86_400_000;
/** How dense a band is painted, so that the line in it is seen. */
const BAND = 0.25;

export class Plot {
  readonly #host: HTMLElement;
  readonly #pointed: (at: number | null) => void;
  readonly #chosen: (from: number, to: number) => void;
  #plot: uPlot | null = null;
  #made = "";
  #drawing: Drawing | null = null;
  readonly #watch: ResizeObserver;

  /** `pointed`: the bucket under the pointer. `chosen`: a span that somebody drew over. */
  constructor(host: HTMLElement, pointed: (at: number | null) => void, chosen: (from: number, to: number) => void) {
    this.#host = host;
    this.#pointed = pointed;
    this.#chosen = chosen;
    this.#watch = new ResizeObserver(() => this.#plot?.setSize(this.#size));
    this.#watch.observe(host);
  }

  get #size(): { width: number; height: number } {
    const { clientWidth, clientHeight } = this.#host;
    return { width: Math.max(120, Math.floor(clientWidth)), height: Math.max(120, Math.floor(clientHeight)) };
  }

  draw(drawing: Drawing): void {
    this.#drawing = drawing;
    const data = columns(drawing.times, drawing.lines.map(({ buckets }) => buckets)) as uPlot.AlignedData;
    const made = [drawing.zone, ...drawing.lines.map(({ colour, isDashed }) => `${colour} ${isDashed}`)].join();
    if (this.#plot === null || made !== this.#made) {
      this.#plot?.destroy();
      this.#plot = new uPlot(this.#options(drawing), data, this.#host);
      this.#made = made;
    } else {
      this.#plot.setData(data);
    }
  }

  /** Draws it in the colours of now. */
  redraw(): void {
    this.#plot?.redraw(false);
  }

  end(): void {
    this.#watch.disconnect();
    this.#plot?.destroy();
    this.#plot = null;
  }

  #options({ lines }: Drawing): uPlot.Options {
    const style = getComputedStyle(this.#host);
    const token = (name: string): string => style.getPropertyValue(`--${name}`).trim();
    const font = `12px ${style.fontFamily}`;
    const axis: uPlot.Axis = {
      stroke: () => token("muted"),
      font,
      grid: { stroke: () => token("line"), width: 1 },
      ticks: { stroke: () => token("line"), width: 1 },
    };
    return {
      ...this.#size,
      legend: { show: false },
      tzDate: (seconds) => uPlot.tzDate(new Date(seconds * 1000), shownZone(this.#drawing?.zone ?? "UTC")),
      scales: {
        x: { time: true, range: () => this.#across() },
        y: { range: () => this.#up() },
      },
      axes: [
        { ...axis, space: 80, values: (_, splits) => splits.map((at) => this.#tick(at * 1000)) },
        { ...axis, size: 64 },
      ],
      cursor: { drag: { x: true, y: false, setScale: false }, points: { show: false } },
      hooks: {
        drawAxes: [(plot) => this.#bands(plot, token)],
        setCursor: [
          (plot) => {
            const at = plot.cursor.idx ?? null;
            this.#pointed(at === null ? null : Math.floor(at / 2));
          },
        ],
        setSelect: [
          (plot) => {
            const { left, width } = plot.select;
            if (width < 4) return;
            const [from, to] = [left, left + width].map((x) => plot.posToVal(x, "x") * 1000) as [number, number];
            plot.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
            this.#chosen(from, to);
          },
        ],
      },
      series: [
        {},
        ...lines.map(
          ({ colour, isDashed }): uPlot.Series => ({
            stroke: () => token(`j${colour}`),
            width: 1.5,
            dash: isDashed ? [6, 4] : [],
            spanGaps: false,
            points: { show: true, size: 4, fill: () => token(`j${colour}`), filter: (plot, at) => lone(plot.data[at] ?? []) },
          }),
        ),
      ],
    };
  }

  #across(): [number, number] {
    const { from, to } = this.#drawing ?? { from: 0, to: 1 };
    return [from / 1000, to / 1000];
  }

  #up(): [number, number] {
    const rows = this.#drawing?.lines.map(({ buckets }) => buckets.filter((one) => one !== undefined)) ?? [];
    return extent(rows) ?? [0, 1];
  }

  #tick(at: number): string {
    const { from, to, zone } = this.#drawing!;
    const [day = "", time = ""] = wall(at, zone).split("T");
    if (to - from > 3 * DAY) return time === "00:00:00" || to - from > 30 * DAY ? day.slice(2) : `${day.slice(5)} ${time.slice(0, 5)}`;
    return to - from > DAY && time === "00:00:00" ? day.slice(5) : time.endsWith(":00") ? time.slice(0, 5) : time;
  }

  /** From min to max of each bucket. A bucket without a value has none. */
  #bands(plot: uPlot, token: (name: string) => string): void {
    const { ctx } = plot;
    const { left, top, width, height } = plot.bbox;
    ctx.save();
    ctx.beginPath();
    ctx.rect(left, top, width, height);
    ctx.clip();
    ctx.globalAlpha = BAND;
    for (const { colour, buckets } of this.#drawing?.lines ?? []) {
      ctx.fillStyle = token(`j${colour}`);
      for (const bucket of buckets) {
        if (bucket === undefined || bucket.min === null || bucket.max === null) continue;
        const [x, end] = [bucket.at, bucket.at + bucket.width].map((at) => plot.valToPos(at / 1000, "x", true)) as [number, number];
        const [high, low] = [bucket.max, bucket.min].map((value) => plot.valToPos(value, "y", true)) as [number, number];
        ctx.fillRect(x, high, Math.max(1, end - x), Math.max(1, low - high));
      }
    }
    ctx.restore();
  }
}
