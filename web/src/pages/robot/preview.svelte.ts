/** The path that a prepared program would take, for the picture of the arm of its robot. */
import type { PathPoint } from "../../scene/mount.ts";

const NO_PATH: readonly PathPoint[] = [];

class Preview {
  #shown = $state.raw<{ robot: string; points: readonly PathPoint[] } | null>(null);

  of(robot: string): readonly PathPoint[] {
    return this.#shown?.robot === robot ? this.#shown.points : NO_PATH;
  }

  show(robot: string, points: readonly PathPoint[]): void {
    this.#shown = { robot, points };
  }

  clear(): void {
    this.#shown = null;
  }
}

export const preview = new Preview();
