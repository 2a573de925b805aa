/** The workspace of a robot's guard in the picture: a dashed box. Pure parts are in `model.ts`. */
import { BoxGeometry, EdgesGeometry, Group, LineDashedMaterial, LineSegments } from "three";
import type { Colours } from "./colours.ts";
import type { Vector } from "./model.ts";

/** Lowest and highest corner, in mm, in the base frame. */
export type Box = readonly [Vector, Vector];

export class Workspace {
  readonly group = new Group();
  private lines: LineSegments<EdgesGeometry, LineDashedMaterial> | null = null;

  /** `dash`: the length of a dash in mm. */
  constructor(private readonly dash: number) {}

  /** Shows this box; `null` takes it away. */
  show(box: Box | null, colours: Colours): void {
    this.dispose();
    if (box === null) return;
    const [low, high] = box;
    const sizes = low.map((from, at) => (high[at] ?? 0) - from) as [number, number, number];
    const middle = low.map((from, at) => (from + (high[at] ?? 0)) / 2) as [number, number, number];
    const solid = new BoxGeometry(...sizes).translate(...middle);
    const material = new LineDashedMaterial({ color: colours.text, dashSize: this.dash, gapSize: this.dash });
    this.lines = new LineSegments(new EdgesGeometry(solid), material);
    this.lines.computeLineDistances();
    solid.dispose();
    this.group.add(this.lines);
  }

  dispose(): void {
    if (this.lines === null) return;
    this.group.remove(this.lines);
    this.lines.geometry.dispose();
    this.lines.material.dispose();
    this.lines = null;
  }
}
