/**
 * Puts the picture of an arm on a page. three comes as a chunk of its own when the first picture is shown.
 */
import type { ArmModel } from "../api/types.ts";
import type { Scene } from "./scene.ts";

export type { PathKind, PathPoint } from "./path.ts";
export type { Scene } from "./scene.ts";
export { VIEWS, type ViewName } from "./camera.ts";

/** Why there is no picture. */
export class NoPicture extends Error {
  /** `graphics`: this browser draws no 3D now. `part`: the chunk with three could not be loaded. */
  constructor(readonly why: "graphics" | "part") {
    super(why);
  }
}

/**
 * Shows a model in a canvas. `dispose` of the result frees what it holds; the canvas cannot be used again
 * then.
 *
 * @throws NoPicture
 */
export async function mount(canvas: HTMLCanvasElement, model: ArmModel): Promise<Scene> {
  // three says on the console that there is no context, so it is asked for here.
  const context = canvas.getContext("webgl2", { antialias: true, powerPreference: "low-power" });
  if (context === null) throw new NoPicture("graphics");
  try {
    const { Scene } = await import("./scene.ts");
    return new Scene(canvas, context, model);
  } catch {
    throw new NoPicture(context.isContextLost() ? "graphics" : "part");
  }
}
