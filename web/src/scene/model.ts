/**
 * What an arm is, and where its axes carry the tool: r6-motion's forward kinematics for a picture. Pure,
 * without three. Lengths are in mm, angles in degrees, Z is up.
 */
import type { ArmModel, GuardRange } from "../api/types.ts";

export type Vector = readonly [number, number, number];

/** A coordinate system in the base frame: its origin, and the directions of its X, Y and Z. */
export interface Place {
  at: Vector;
  x: Vector;
  y: Vector;
  z: Vector;
}

export type Direction = "x" | "y" | "z";

/** One axis in a picture. */
export interface Joint {
  /** Where it is, before it turns or slides. */
  place: Place;
  /** About or along which direction of `place` it moves. */
  about: Direction;
  /** Where it is after it turned or slid: what it carries hangs there. */
  moved: Place;
}

/** An arm as it stands. */
export interface Standing {
  /** J1 first. */
  joints: Joint[];
  /** Where a tool is mounted. X of a six-axis arm points away from it, Z of the others up. */
  flange: Place;
  /** What the controller calls tool 0. */
  tool: Place;
}

export const ORIGIN: Place = { at: [0, 0, 0], x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1] };

const RADIANS = Math.PI / 180;
/** An axis within this part of its range of a soft limit is near it. */
const NEAR = 0.03;

export function add(a: Vector, b: Vector, times = 1): Vector {
  return [a[0] + b[0] * times, a[1] + b[1] * times, a[2] + b[2] * times];
}

/** A point of the coordinate system `of` in the base frame. */
export function pointOf(of: Place, [x, y, z]: Vector): Vector {
  return add(add(add(of.at, of.x, x), of.y, y), of.z, z);
}

/** The coordinate system with its origin at a point of itself. */
export function shifted(of: Place, by: Vector): Place {
  return { ...of, at: pointOf(of, by) };
}

/** The coordinate system turned about one of its own directions. */
export function turned(of: Place, about: Direction, degrees: number): Place {
  const [cos, sin] = [Math.cos(degrees * RADIANS), Math.sin(degrees * RADIANS)];
  const mix = (a: Vector, b: Vector, s: number): Vector => [
    a[0] * cos + b[0] * s,
    a[1] * cos + b[1] * s,
    a[2] * cos + b[2] * s,
  ];
  const { x, y, z } = of;
  if (about === "x") return { ...of, y: mix(y, z, sin), z: mix(z, y, -sin) };
  if (about === "y") return { ...of, z: mix(z, x, sin), x: mix(x, z, -sin) };
  return { ...of, x: mix(x, y, sin), y: mix(y, x, -sin) };
}

/** The positions of the geometry, `sign * axis + offset`. Axes without a value stand at 0. */
export function geometric(model: ArmModel, axes: readonly number[]): number[] {
  return model.axes.map(({ sign, offset }, at) => sign * (axes[at] ?? 0) + offset);
}

/** Where everything is with the axes at these positions, J1 first, in degrees or mm. */
export function stands(model: ArmModel, axes: readonly number[]): Standing {
  const at = geometric(model, axes);
  const g = model.geometry;
  const joints: Joint[] = [];
  let place = ORIGIN;
  const turn = (about: Direction, degrees: number): void => {
    const moved = turned(place, about, degrees);
    joints.push({ place, about, moved });
    place = moved;
  };
  const slide = (about: Direction, mm: number): void => {
    const moved = shifted(place, about === "x" ? [mm, 0, 0] : about === "y" ? [0, mm, 0] : [0, 0, mm]);
    joints.push({ place, about, moved });
    place = moved;
  };
  const go = (x: number, y: number, z: number): void => {
    place = shifted(place, [x, y, z]);
  };
  const [j1 = 0, j2 = 0, j3 = 0, j4 = 0, j5 = 0, j6 = 0] = at;
  switch (g.kind) {
    case "six_axis": {
      turn("z", j1);
      go(g.a1, g.b, g.d1);
      turn("y", j2);
      go(0, 0, g.a2);
      turn("y", j3);
      go(0, 0, g.a3);
      turn("x", j4);
      go(g.d4, 0, 0);
      turn("y", j5);
      turn("x", j6);
      go(g.d6, 0, 0);
      const flange = place;
      go(g.tool_offset, 0, 0);
      // Z of the tool is the approach, which is X of the wrist.
      const { at, x, y, z } = place;
      return { joints, flange, tool: { at, x: [-z[0], -z[1], -z[2]], y, z: x } };
    }
    case "scara":
      go(0, 0, g.height);
      turn("z", j1);
      go(g.upper_arm, 0, 0);
      turn("z", j2);
      go(g.forearm, 0, 0);
      slide("z", j3);
      turn("z", j4);
      return { joints, flange: place, tool: place };
    case "cartesian":
      slide("x", j1);
      slide("y", j2);
      slide("z", j3);
      if (model.axes.length > 3) turn("z", j4);
      return { joints, flange: place, tool: place };
  }
}

/**
 * A place as the controller tells a pose: X, Y, Z in mm, and in degrees U, V, W with R = Rz(W) Ry(V) Rx(U). A
 * machine that turns its tool about Z alone tells that turn as U.
 */
export function poseOf(model: ArmModel, { at, x, y, z }: Place): [number, number, number, number, number, number] {
  if (model.geometry.kind !== "six_axis") return [...at, Math.atan2(x[1], x[0]) / RADIANS, 0, 0];
  const flat = Math.hypot(x[0], x[1]);
  // With V at 90 degrees U and W turn about one line: W has the whole turn.
  if (flat < 1e-9) return [...at, 0, Math.atan2(-x[2], flat) / RADIANS, Math.atan2(-y[0], y[1]) / RADIANS];
  const [u, v, w] = [Math.atan2(y[2], z[2]), Math.atan2(-x[2], flat), Math.atan2(x[1], x[0])];
  return [...at, u / RADIANS, v / RADIANS, w / RADIANS];
}

/** How large the arm is: both links of an arm, the largest range of a machine that slides. Sizes go by it. */
export function linksOf(model: ArmModel): number {
  const g = model.geometry;
  if (g.kind === "six_axis") return g.a2 + g.d4;
  if (g.kind === "scara") return g.upper_arm + g.forearm;
  return Math.max(...model.axes.filter(({ unit }) => unit === "mm").map(({ limits: [low = 0, high = 0] }) => high - low), 1);
}

/** A box round all that the tool can reach: lowest and highest corner. */
export function spaceOf(model: ArmModel): [Vector, Vector] {
  const g = model.geometry;
  if (g.kind === "cartesian") {
    const [x, y, z] = [0, 1, 2].map((at) => rangeOf(model, at));
    return [
      [x?.[0] ?? 0, y?.[0] ?? 0, z?.[0] ?? 0],
      [x?.[1] ?? 0, y?.[1] ?? 0, z?.[1] ?? 0],
    ];
  }
  if (g.kind === "scara") {
    const reach = g.upper_arm + g.forearm;
    const [low, high] = rangeOf(model, 2);
    return [
      [-reach, -reach, Math.min(0, g.height + low)],
      [reach, reach, g.height + high],
    ];
  }
  const arm = g.a2 + Math.hypot(g.a3, g.d4) + g.d6 + g.tool_offset;
  const reach = g.a1 + arm;
  return [
    [-reach, -reach, 0],
    [reach, reach, g.d1 + arm],
  ];
}

/**
 * The box of a guard's ranges of `x`, `y` and `z` in mm, lowest and highest corner; `null` without a range. Where no
 * range limits it, it goes as far as the tool can reach, and a little further.
 */
export function workspaceOf(model: ArmModel, ranges: readonly GuardRange[]): [Vector, Vector] | null {
  if (ranges.length === 0) return null;
  const [low, high] = spaceOf(model);
  const beyond = 0.05 * linksOf(model);
  const of = (name: string, from: number, to: number): [number, number] => {
    const range = ranges.find((one) => one.of === name);
    return range === undefined ? [from - beyond, to + beyond] : [range.lowest, range.highest];
  };
  const [x, y, z] = [of("x", low[0], high[0]), of("y", low[1], high[1]), of("z", low[2], high[2])];
  return [
    [x[0], y[0], z[0]],
    [x[1], y[1], z[1]],
  ];
}

/** Where the floor is drawn. A machine that hangs over its work has its zero above the floor. */
export function floorOf(model: ArmModel): number {
  return model.geometry.kind === "cartesian" ? Math.min(0, rangeOf(model, 2)[0]) : 0;
}

/** The soft limits of an axis as positions of the geometry, the lower one first. */
export function rangeOf(model: ArmModel, axis: number): [number, number] {
  const of = model.axes[axis];
  if (of === undefined) return [0, 0];
  const [a = 0, b = 0] = of.limits.map((limit) => of.sign * limit + of.offset);
  return [Math.min(a, b), Math.max(a, b)];
}

export type Nearness = "inside" | "near" | "beyond";

/** Whether an axis stands within its soft limits, near one (3 % of the range), or beyond one. */
export function nearness(position: number, [low, high]: readonly [number, number]): Nearness {
  if (position < low || position > high) return "beyond";
  return Math.min(position - low, high - position) < (high - low) * NEAR ? "near" : "inside";
}
