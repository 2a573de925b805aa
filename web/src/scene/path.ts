/** Paths of the tool: where it was in the last minute, and where a plan would take it. */
import {
  BoxGeometry,
  BufferAttribute,
  BufferGeometry,
  Color,
  Group,
  InstancedMesh,
  LineBasicMaterial,
  LineSegments,
  Matrix4,
  MeshBasicMaterial,
  OctahedronGeometry,
  Points,
  PointsMaterial,
} from "three";
import type { Colours } from "./colours.ts";
import type { Vector } from "./model.ts";

/** For how long the path of the tool is shown, in milliseconds, and its points at most. */
export const SHOWN = 60_000;
const MOST = 2_000;
/** Points nearer than this, in mm or milliseconds, are left out. */
const STEP = 1;
const EVERY = 40;

/** Where the tool was, as single lines: a gap stays a gap. */
export class Trail {
  readonly group = new Group();
  private readonly positions = new BufferAttribute(new Float32Array(MOST * 6), 3);
  private readonly times: number[] = [];
  private readonly line: LineSegments<BufferGeometry, LineBasicMaterial>;
  private readonly points: Points<BufferGeometry, PointsMaterial>;
  private last: { at: Vector; time: number } | null = null;

  constructor(colours: Colours) {
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", this.positions);
    this.line = new LineSegments(geometry, new LineBasicMaterial());
    this.points = new Points(geometry, new PointsMaterial({ size: 3, sizeAttenuation: false }));
    // The boxes of three are those of the whole buffer, with what was left out.
    this.line.frustumCulled = false;
    this.points.frustumCulled = false;
    this.group.add(this.line, this.points);
    this.colour(colours);
    this.show();
  }

  /** The tool is here now. */
  add(at: Vector, time: number): void {
    const { last } = this;
    if (last === null) {
      this.last = { at, time };
      return;
    }
    const far = Math.hypot(at[0] - last.at[0], at[1] - last.at[1], at[2] - last.at[2]);
    if (far < STEP || time - last.time < EVERY) return;
    if (this.times.length === MOST) this.drop(MOST / 10);
    this.positions.array.set([...last.at, ...at], this.times.length * 6);
    this.times.push(time);
    this.last = { at, time };
    this.show();
  }

  /** Where the tool is now is not known: what follows is not joined to what was. */
  gap(): void {
    this.last = null;
  }

  /** Takes away what is older than a minute. Returns whether something is left. */
  age(now: number): boolean {
    const first = this.times.findIndex((time) => now - time <= SHOWN);
    const old = first < 0 ? this.times.length : first;
    if (old > 0) this.drop(old);
    return this.times.length > 0;
  }

  get length(): number {
    return this.times.length;
  }

  colour(colours: Colours): void {
    this.line.material.color.set(colours.accent);
    this.points.material.color.set(colours.accent);
  }

  dispose(): void {
    this.line.geometry.dispose();
    this.line.material.dispose();
    this.points.material.dispose();
  }

  private drop(count: number): void {
    this.positions.array.copyWithin(0, count * 6, this.times.length * 6);
    this.times.splice(0, count);
    this.show();
  }

  private show(): void {
    this.line.geometry.setDrawRange(0, this.times.length * 2);
    this.positions.needsUpdate = true;
  }
}

export type PathKind = "ok" | "near" | "beyond" | "singular";

export interface PathPoint {
  at: Vector;
  /** What the plan says of the arm there. */
  kind: PathKind;
}

/** A planned path: a line with colours, squares where a limit is, diamonds where the arm is singular. */
export class Planned {
  readonly group = new Group();
  private made: { dispose(): void }[] = [];

  constructor(private readonly size: number) {}

  show(points: readonly PathPoint[], colours: Colours): void {
    this.dispose();
    if (points.length === 0) return;
    const positions = new Float32Array((points.length - 1) * 6);
    const painted = new Float32Array((points.length - 1) * 6);
    points.slice(1).forEach((to, index) => {
      const from = points[index] ?? to;
      positions.set([...from.at, ...to.at], index * 6);
      // A line is as bad as its worse end.
      const worse = worst(from.kind, to.kind);
      const { r, g, b } = new Color(colours[worse]);
      painted.set([r, g, b, r, g, b], index * 6);
    });
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(positions, 3));
    geometry.setAttribute("color", new BufferAttribute(painted, 3));
    const line = new LineBasicMaterial({ vertexColors: true });
    const dots = new PointsMaterial({ vertexColors: true, size: 4, sizeAttenuation: false });
    this.group.add(new LineSegments(geometry, line), new Points(geometry, dots));
    this.made.push(geometry, line, dots);
    const side = 0.02 * this.size;
    this.mark(points, "near", new BoxGeometry(side, side, side), colours.near);
    this.mark(points, "beyond", new BoxGeometry(side, side, side), colours.beyond);
    this.mark(points, "singular", new OctahedronGeometry(side * 0.8), colours.singular);
  }

  dispose(): void {
    this.group.clear();
    for (const one of this.made.splice(0)) one.dispose();
  }

  /** A shape at the first point of each stretch of a kind: one for a stretch, however many samples it has. */
  private mark(points: readonly PathPoint[], kind: PathKind, geometry: BufferGeometry, colour: string): void {
    const first = points.filter((point, at) => point.kind === kind && points[at - 1]?.kind !== kind);
    const material = new MeshBasicMaterial({ color: colour });
    this.made.push(geometry, material);
    if (first.length === 0) return;
    const mesh = new InstancedMesh(geometry, material, first.length);
    first.forEach(({ at }, index) => mesh.setMatrixAt(index, new Matrix4().makeTranslation(...at)));
    this.made.push(mesh);
    this.group.add(mesh);
  }
}

const ORDER: readonly PathKind[] = ["ok", "near", "singular", "beyond"];

function worst(a: PathKind, b: PathKind): PathKind {
  return ORDER.indexOf(a) > ORDER.indexOf(b) ? a : b;
}
