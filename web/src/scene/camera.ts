/** Where the picture is seen from: a point that a person turns about another. Pure, without three. */
import { type Vector, add } from "./model.ts";

export const VIEWS = ["iso", "top", "side", "tool"] as const;
export type ViewName = (typeof VIEWS)[number];

/** How far from straight up and down the view stays, in radians: there left and right would be lost. */
const POLE = 0.01;
/** The opening of the lens from top to bottom, in degrees. */
export const LENS = 35;

/** Angles in radians: `azimuth` from +X to the left, `elevation` upwards. */
interface Angles {
  azimuth: number;
  elevation: number;
}

const ANGLES: Record<ViewName, Angles> = {
  iso: { azimuth: -0.9, elevation: 0.5 },
  top: { azimuth: -Math.PI / 2, elevation: Math.PI / 2 - POLE },
  side: { azimuth: -Math.PI / 2, elevation: 0 },
  tool: { azimuth: -0.9, elevation: 0.35 },
};

export class Orbit {
  #angles = ANGLES.iso;
  #distance: number;
  /** Whether the view follows the tool. */
  follows = false;
  target: Vector;

  /** Sees all of a sphere. */
  constructor(
    private readonly centre: Vector,
    private readonly radius: number,
  ) {
    this.target = centre;
    this.#distance = this.#far();
  }

  /** Where the eye is. */
  get eye(): Vector {
    const { azimuth, elevation } = this.#angles;
    const flat = Math.cos(elevation);
    const towards: Vector = [flat * Math.cos(azimuth), flat * Math.sin(azimuth), Math.sin(elevation)];
    return add(this.target, towards, this.#distance);
  }

  get distance(): number {
    return this.#distance;
  }

  /** One of the named views. That of the tool stays with the tool. */
  view(name: ViewName, tool: Vector | null): void {
    this.#angles = ANGLES[name];
    this.follows = name === "tool" && tool !== null;
    this.target = this.follows && tool !== null ? tool : this.centre;
    this.#distance = this.follows ? this.#far() / 3 : this.#far();
  }

  /** Turns by so much, in radians: to the left, and upwards. Never over the poles. */
  turn(left: number, up: number): void {
    const most = Math.PI / 2 - POLE;
    const { azimuth, elevation } = this.#angles;
    this.#angles = { azimuth: azimuth + left, elevation: Math.min(most, Math.max(-most, elevation + up)) };
  }

  /** Goes nearer (above 1) or further away (below 1), within a tenth and four times the whole view. */
  zoom(factor: number): void {
    const whole = this.#far();
    this.#distance = Math.min(whole * 4, Math.max(whole / 10, this.#distance / factor));
  }

  #far(): number {
    return this.radius / Math.sin(((LENS / 2) * Math.PI) / 180);
  }
}
