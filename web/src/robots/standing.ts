/** Since when arms are seen to stand while their programs run. No clock: times are those of the caller. */
import { type View, isRunning, isSeen } from "./view.ts";

export class Standing {
  readonly #since = new Map<string, number>();

  note(view: View, now: number): void {
    if (!isSeen(view) || view.moving !== false || !isRunning(view)) this.#since.delete(view.name);
    else if (!this.#since.has(view.name)) this.#since.set(view.name, now);
  }

  /** `null` if it is not seen to stand, or if its program does not run. */
  since(robot: string): number | null {
    return this.#since.get(robot) ?? null;
  }

  /** What the robots do is not seen any more. */
  clear(): void {
    this.#since.clear();
  }
}
