/** Speed and torque of the motors: what a controller tells of them besides the axes. */
import type { Queried } from "../../api/types.ts";

/** `curTorque-n` at the rated torque (manual 4.1.1). */
const RATED = 2_580;

export interface Motor {
  axis: number;
  /** In revolutions per minute; `null` if the controller does not tell it. */
  speed: number | null;
  /** In percent of the rated torque. */
  torque: number | null;
}

export function motorAddresses(axes: number): string[] {
  const all = Array.from({ length: axes }, (_, axis) => axis);
  return [...all.map((axis) => `curSpeed-${axis}`), ...all.map((axis) => `curTorque-${axis}`)];
}

/** The motors that the controller tells something about. */
export function motorsOf(queried: Queried, axes: number): Motor[] {
  const values = new Map(queried.signals.map(({ address, value }) => [address, value]));
  const number = (address: string): number | null => {
    const value = values.get(address);
    return typeof value === "number" ? value : null;
  };
  const motors = Array.from({ length: axes }, (_, axis): Motor => {
    const torque = number(`curTorque-${axis}`);
    return { axis, speed: number(`curSpeed-${axis}`), torque: torque === null ? null : (torque / RATED) * 100 };
  });
  return motors.filter(({ speed, torque }) => speed !== null || torque !== null);
}
