/** The meshes of an arm, made of the lengths of its model, and the arcs of its soft limits. */
import {
  type BufferGeometry,
  BoxGeometry,
  CapsuleGeometry,
  CylinderGeometry,
  DoubleSide,
  Group,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  MeshLambertMaterial,
  Object3D,
  RingGeometry,
} from "three";
import type { ArmModel } from "../api/types.ts";
import type { Colours } from "./colours.ts";
import { type Direction, type Place, type Standing, geometric, linksOf, nearness, rangeOf, stands } from "./model.ts";

/** Sides of a round part: an arm has 4000 triangles at most. */
const SIDES = 20;
const AXIS_COLOURS = ["j1", "j2", "j3", "j4", "j5", "j6"] as const;
/** The direction of the link of each axis with the geometry at 0, from which its arc is drawn. */
const LINK_DIRECTIONS: Record<ArmModel["geometry"]["kind"], Direction[]> = {
  six_axis: ["x", "z", "x", "z", "x", "z"],
  scara: ["x", "x", "x", "x"],
  cartesian: ["x", "x", "x", "x"],
};

/** Where a part hangs: -1 at the floor, else behind the axis with this number, from 0. */
type Hangs = number;

interface Mark {
  axis: number;
  mesh: Mesh<BufferGeometry, MeshBasicMaterial>;
}

export class Arm {
  readonly group = new Group();
  private readonly carriers: Group[];
  private readonly base = new Group();
  private readonly limits = new Group();
  private readonly tool = new Group();
  private readonly body: MeshLambertMaterial;
  private readonly joint: MeshLambertMaterial;
  private readonly arcs: { axis: number; place: Group; material: MeshBasicMaterial }[] = [];
  private readonly marks: Mark[] = [];
  private colours: Colours;
  /** All lengths go by this one. */
  private readonly size: number;

  /** A ghost shows another position of the same arm: it is seen through and has no limits. */
  constructor(
    private readonly model: ArmModel,
    colours: Colours,
    private readonly isGhost = false,
  ) {
    this.size = linksOf(model);
    this.colours = colours;
    const see = isGhost ? { transparent: true, opacity: 0.3, depthWrite: false } : {};
    this.body = new MeshLambertMaterial(see);
    this.joint = new MeshLambertMaterial(see);
    this.carriers = model.axes.map(() => new Group());
    for (const group of [...this.carriers, this.tool]) group.matrixAutoUpdate = false;
    this.group.add(this.base, this.limits, this.tool, ...this.carriers);
    this.build();
    if (!isGhost) this.buildLimits();
    this.colour(colours);
  }

  /** Shows the axes at these positions. Returns where everything is. */
  pose(axes: readonly number[]): Standing {
    const at = stands(this.model, axes);
    at.joints.forEach(({ moved }, axis) => place(this.carriers[axis], moved));
    place(this.tool, at.tool);
    for (const { axis, place: group } of this.arcs) {
      const joint = at.joints[axis];
      if (joint !== undefined) place(group, joint.place);
    }
    const positions = geometric(this.model, axes);
    for (const { axis, mesh } of this.marks) {
      const how = nearness(positions[axis] ?? 0, rangeOf(this.model, axis));
      mesh.material.color.set(how === "inside" ? this.colours.text : this.colours[how]);
    }
    return at;
  }

  /** An arm that is not read now is half transparent. */
  fade(isOld: boolean): void {
    if (this.isGhost) return;
    for (const material of [this.body, this.joint]) {
      material.transparent = isOld;
      material.opacity = isOld ? 0.35 : 1;
      material.needsUpdate = true;
    }
  }

  colour(colours: Colours): void {
    this.colours = colours;
    this.body.color.set(this.isGhost ? colours.accent : colours.arm);
    this.joint.color.set(this.isGhost ? colours.accent : colours.joint);
    for (const { axis, material } of this.arcs) material.color.set(colours[AXIS_COLOURS[axis] ?? "muted"]);
  }

  dispose(): void {
    this.group.traverse((one) => {
      if (one instanceof Mesh) one.geometry.dispose();
    });
    for (const material of [this.body, this.joint]) material.dispose();
    for (const { material } of this.arcs) material.dispose();
    for (const { mesh } of this.marks) mesh.material.dispose();
  }

  private hang(on: Hangs, geometry: BufferGeometry, isJoint = false): void {
    const mesh = new Mesh(geometry, isJoint ? this.joint : this.body);
    (on < 0 ? this.base : (this.carriers[on] ?? this.base)).add(mesh);
  }

  private build(): void {
    const g = this.model.geometry;
    const s = this.size;
    if (g.kind === "six_axis") {
      const [base, upper, fore, wrist] = [0.14 * s, 0.085 * s, 0.07 * s, 0.05 * s];
      const disc = 1.15;
      this.hang(-1, rod("z", base, Math.max(g.d1 - upper, upper), 0));
      this.hang(0, box([Math.abs(g.a1) + 2 * upper, Math.abs(g.b) + 2.2 * upper, 1.6 * upper], [g.a1 / 2, g.b / 2, g.d1 - 0.3 * upper]));
      this.hang(1, rod("y", upper * disc, 2.4 * upper, -1.2 * upper), true);
      this.hang(1, capsule("z", upper, g.a2));
      this.hang(2, rod("y", fore * disc, 2.6 * fore, -1.3 * fore), true);
      if (Math.abs(g.a3) > 1) this.hang(2, box([1.6 * fore, 1.6 * fore, Math.abs(g.a3)], [0, 0, g.a3 / 2]));
      this.hang(3, capsule("x", fore, g.d4));
      this.hang(4, rod("y", wrist * disc, 2.4 * wrist, -1.2 * wrist), true);
      if (g.d6 > 1) this.hang(4, rod("x", wrist, g.d6 * 0.85, 0));
      this.hang(5, rod("x", wrist * disc, 0.03 * s, g.d6 - 0.03 * s), true);
      // A flange is round: a pin shows how far it is turned.
      this.hang(5, box([0.03 * s, 0.02 * s, 0.03 * s], [g.d6 - 0.015 * s, 0, wrist * disc]));
      this.tool.add(new Mesh(rod("z", 0.007 * s, 0.15 * s + g.tool_offset, -g.tool_offset), this.joint));
      return;
    }
    if (g.kind === "scara") {
      const [upper, fore] = [0.085 * s, 0.07 * s];
      const [low, high] = rangeOf(this.model, 2);
      // The links are above the place of tool 0, so that the slide hangs from them.
      const [lower, above] = [0.16 * s, 0.16 * s + upper + fore];
      this.hang(-1, rod("z", 0.14 * s, g.height + lower - upper, 0));
      this.hang(0, rod("z", upper * 1.15, 2.3 * upper, lower - 1.15 * upper), true);
      this.hang(0, capsule("x", upper, g.upper_arm, [0, 0, lower]));
      this.hang(1, rod("z", fore * 1.15, 2.3 * fore, above - 1.15 * fore), true);
      this.hang(1, capsule("x", fore, g.forearm, [0, 0, above]));
      this.hang(3, rod("z", 0.03 * s, high - low + above + fore + 0.05 * s, 0), true);
      this.hang(3, rod("z", 0.05 * s, 0.03 * s, 0), true);
      this.hang(3, box([0.06 * s, 0.02 * s, 0.02 * s], [0.05 * s, 0, 0.015 * s]));
      return;
    }
    const [x, y, z] = [0, 1, 2].map((axis) => rangeOf(this.model, axis)) as [Range, Range, Range];
    const beam = 0.05 * s;
    const top = z[1] + 2 * beam;
    const back = y[1] + 3 * beam;
    const floor = Math.min(0, z[0]);
    this.hang(-1, box([x[1] - x[0] + 2 * beam, beam, beam], [(x[0] + x[1]) / 2, back, top]));
    for (const at of x) this.hang(-1, box([beam, beam, top - floor], [at, back, (top + floor) / 2]));
    this.hang(0, box([beam, back - y[0] + beam, beam], [0, (y[0] + back) / 2, top + beam]), true);
    this.hang(2, box([0.7 * beam, 0.7 * beam, top - z[0] + 2 * beam], [beam, 0, (top - z[0] + 2 * beam) / 2]));
    const last = this.model.axes.length - 1;
    this.hang(last, rod("z", beam, 0.4 * beam, 0), true);
    this.hang(last, box([beam, 0.4 * beam, 0.4 * beam], [beam, 0, 0.2 * beam]));
  }

  /**
   * Soft limits: an arc round an axis that turns, a bar along one that slides, and a mark where it stands.
   */
  private buildLimits(): void {
    const { geometry, axes } = this.model;
    const directions = LINK_DIRECTIONS[geometry.kind];
    axes.forEach(({ unit }, axis) => {
      const material = new MeshBasicMaterial({ side: DoubleSide });
      const group = new Group();
      group.matrixAutoUpdate = false;
      this.arcs.push({ axis, place: group, material });
      this.limits.add(group);
      const mark = new Mesh<BufferGeometry, MeshBasicMaterial>(undefined, new MeshBasicMaterial());
      this.marks.push({ axis, mesh: mark });
      this.carriers[axis]?.add(mark);
      const range = rangeOf(this.model, axis);
      if (unit === "mm") this.bar(axis, range, group, material, mark);
      else this.arc(axis, range, directions[axis] ?? "x", group, material, mark);
    });
  }

  private arc(
    axis: number,
    [low, high]: Range,
    link: Direction,
    group: Group,
    material: MeshBasicMaterial,
    mark: Mesh,
  ): void {
    const { radius, aside } = this.arcAt(axis);
    const about = this.aboutOf(axis);
    const width = 0.02 * this.size;
    const span = Math.min(high - low, 360);
    const sides = Math.max(8, Math.round(span / 5));
    const ring = new RingGeometry(radius, radius + width, sides, 1, radians(low), radians(span));
    const mesh = new Mesh(ring, material);
    // The ring lies in X and Y of its own: X becomes the direction of the link, Z the axis.
    const [x, z] = [UNIT[link], UNIT[about]];
    const y = [z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0]] as const;
    mesh.matrixAutoUpdate = false;
    mesh.matrix.set(x[0], y[0], z[0], aside[0], x[1], y[1], z[1], aside[1], x[2], y[2], z[2], aside[2], 0, 0, 0, 1);
    group.add(mesh);
    const long = 2.2 * width;
    mark.geometry = new BoxGeometry(...(UNIT[link].map((one) => (one === 1 ? long : width * 0.6)) as [number, number, number]));
    mark.position.set(...(UNIT[link].map((one, at) => one * (radius + width / 2) + (aside[at] ?? 0)) as [number, number, number]));
  }

  private bar(axis: number, [low, high]: Range, group: Group, material: MeshBasicMaterial, mark: Mesh): void {
    const width = 0.02 * this.size;
    const along = this.aboutOf(axis);
    const aside = this.arcAt(axis).aside;
    const sizes = UNIT[along].map((one) => (one === 1 ? high - low : width)) as [number, number, number];
    const middle = UNIT[along].map((one, at) => one * ((high + low) / 2) + (aside[at] ?? 0)) as [number, number, number];
    group.add(new Mesh(box(sizes, middle), material));
    mark.geometry = new BoxGeometry(...(UNIT[along].map((one) => (one === 1 ? width * 0.6 : 2.2 * width)) as [number, number, number]));
    mark.position.set(...aside);
  }

  private aboutOf(axis: number): Direction {
    return stands(this.model, []).joints[axis]?.about ?? "z";
  }

  /**
   * How large the arc of an axis is, and how far it lies beside the middle, so that the arm does not hide it.
   */
  private arcAt(axis: number): { radius: number; aside: [number, number, number] } {
    const g = this.model.geometry;
    const s = this.size;
    if (g.kind === "six_axis") {
      const all: [number, [number, number, number]][] = [
        [0.21 * s, [0, 0, 0.015 * s]],
        [0.13 * s, [0, -0.12 * s, 0]],
        [0.11 * s, [0, -0.11 * s, 0]],
        [0.095 * s, [g.d4 * 0.45, 0, 0]],
        [0.08 * s, [0, -0.075 * s, 0]],
        [0.075 * s, [g.d6 * 0.5, 0, 0]],
      ];
      const [radius, aside] = all[axis] ?? [0.1 * s, [0, 0, 0]];
      return { radius, aside };
    }
    if (g.kind === "scara") {
      const all: [number, [number, number, number]][] = [
        [0.21 * s, [0, 0, -g.height + 0.015 * s]],
        [0.13 * s, [0, 0, 0.16 * s + 0.085 * s * 1.1]],
        [0, [0, -0.09 * s, 0]],
        [0.09 * s, [0, 0, 0.06 * s]],
      ];
      const [radius, aside] = all[axis] ?? [0.1 * s, [0, 0, 0]];
      return { radius, aside };
    }
    const [, y, z] = [0, 1, 2].map((one) => rangeOf(this.model, one)) as [Range, Range, Range];
    const beam = 0.05 * s;
    const top = z[1] + 2 * beam;
    const all: [number, [number, number, number]][] = [
      [0, [0, y[1] + 2.3 * beam, top]],
      [0, [-0.7 * beam, 0, top + beam]],
      [0, [1.6 * beam, 0, 0]],
      [1.6 * beam, [0, 0, 0.2 * beam]],
    ];
    const [radius, aside] = all[axis] ?? [beam, [0, 0, 0]];
    return { radius, aside };
  }
}

type Range = [number, number];

const UNIT: Record<Direction, readonly [number, number, number]> = { x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1] };

const radians = (degrees: number): number => (degrees * Math.PI) / 180;

/** Puts an object where a place is. */
export function place(object: Object3D | undefined, { at, x, y, z }: Place): void {
  if (object === undefined) return;
  object.matrixAutoUpdate = false;
  object.matrix = new Matrix4().set(x[0], y[0], z[0], at[0], x[1], y[1], z[1], at[1], x[2], y[2], z[2], at[2], 0, 0, 0, 1);
  object.matrixWorldNeedsUpdate = true;
}

/** A shape that lies along Y, turned along another direction. */
function along<G extends BufferGeometry>(geometry: G, direction: Direction): G {
  if (direction === "x") geometry.rotateZ(-Math.PI / 2);
  if (direction === "z") geometry.rotateX(Math.PI / 2);
  return geometry;
}

/** A cylinder along a direction, from `from` on. */
function rod(direction: Direction, radius: number, length: number, from: number): BufferGeometry {
  const [x, y, z] = UNIT[direction].map((one) => one * (from + length / 2)) as [number, number, number];
  return along(new CylinderGeometry(radius, radius, Math.max(length, 0.1), SIDES), direction).translate(x, y, z);
}

/** A cylinder with round ends along a direction, from the origin of its place, or from `at`, to so far. */
function capsule(
  direction: Direction,
  radius: number,
  length: number,
  at: readonly [number, number, number] = [0, 0, 0],
): BufferGeometry {
  const [x, y, z] = UNIT[direction].map((one, part) => one * (length / 2) + (at[part] ?? 0)) as [number, number, number];
  return along(new CapsuleGeometry(radius, Math.max(length, 0.1), 6, SIDES), direction).translate(x, y, z);
}

function box(sizes: [number, number, number], middle: [number, number, number]): BufferGeometry {
  return new BoxGeometry(...sizes).translate(...middle);
}
