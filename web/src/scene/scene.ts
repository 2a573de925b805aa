/** The picture: an arm on its floor, the paths of its tool, and a camera. It is drawn only after a change. */
import {
  CanvasTexture,
  Color,
  DirectionalLight,
  DoubleSide,
  Group,
  HemisphereLight,
  LineBasicMaterial,
  LineSegments,
  BufferAttribute,
  BufferGeometry,
  Mesh,
  MeshBasicMaterial,
  NearestFilter,
  PerspectiveCamera,
  PlaneGeometry,
  RepeatWrapping,
  SRGBColorSpace,
  Scene as World,
  Sprite,
  SpriteMaterial,
  WebGLRenderer,
} from "three";
import type { ArmModel } from "../api/types.ts";
import { Arm, place } from "./arm.ts";
import { LENS, Orbit, type ViewName } from "./camera.ts";
import { type Colours, coloursOf } from "./colours.ts";
import { type Box, Workspace } from "./guard.ts";
import { Late } from "./late.ts";
import { ORIGIN, type Standing, type Vector, floorOf, linksOf, rangeOf, spaceOf } from "./model.ts";
import { type PathPoint, Planned, Trail } from "./path.ts";

/** The grid of the floor, in mm. */
export const GRID = 100;
/** How often the path of the last minute is made shorter, in milliseconds. */
const AGES = 1_000;
/** A screen has more pixels than this for each of the page's: they are not drawn. */
const MOST_PIXELS = 2;

export class Scene {
  private readonly world = new World();
  private readonly renderer: WebGLRenderer;
  private readonly camera = new PerspectiveCamera(LENS, 1);
  private readonly orbit: Orbit;
  private readonly arm: Arm;
  private readonly trail: Trail;
  private readonly planned: Planned;
  private readonly workspace: Workspace;
  private readonly late = new Late();
  private readonly size: number;
  private readonly sun = new DirectionalLight(0xffffff, 2.4);
  private readonly frames: Frames[];
  private ghostArm: Arm | null = null;
  private ground = new Group();
  private isVirtual = false;
  private points: readonly PathPoint[] = [];
  private box: Box | null = null;
  private colours: Colours;
  private standing: Standing | null = null;
  private scheduled: number | null = null;
  private readonly ages: ReturnType<typeof setInterval>;
  private readonly watched: ResizeObserver;
  private isOver = false;

  /** Draws the model into the canvas, with the context of the canvas. */
  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly context: WebGL2RenderingContext,
    private readonly model: ArmModel,
  ) {
    this.renderer = new WebGLRenderer({ canvas, context, antialias: true });
    this.size = linksOf(model);
    this.colours = coloursOf(canvas);
    this.arm = new Arm(model, this.colours);
    this.arm.group.visible = false;
    this.trail = new Trail(this.colours);
    this.planned = new Planned(this.size);
    this.workspace = new Workspace(this.size * 0.03);
    this.frames = [new Frames(this.size * 0.3), new Frames(this.size * 0.15)];
    const [low, high] = spaceOf(model);
    const { kind } = model.geometry;
    const isMachine = kind === "cartesian";
    // The slide of a SCARA stands above the links when it is up.
    const [slideLow, slideHigh] = rangeOf(model, 2);
    const top = high[2] + (kind === "scara" ? slideHigh - slideLow + 0.4 * this.size : 0);
    const [down, up] = isMachine ? [0.4, 0.6] : [0.6, 0.4];
    const centre: Vector = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2] * down + top * up];
    const radius = Math.hypot(high[0] - low[0], high[1] - low[1], top - low[2]) / 2;
    // The corners of the space that an arm reaches are empty.
    this.orbit = new Orbit(centre, radius * (isMachine ? 1.1 : 0.6));
    this.camera.up.set(0, 0, 1);
    const sky = new HemisphereLight(0xffffff, 0x888888, 2.4);
    sky.position.set(0, 0, 1);
    this.world.add(sky, this.sun);
    this.world.add(this.arm.group, this.trail.group, this.planned.group, this.workspace.group);
    for (const { group } of this.frames) this.world.add(group);
    this.floor(false);
    this.recolour();
    this.watched = new ResizeObserver(() => this.resize());
    this.watched.observe(canvas);
    this.resize();
    this.ages = setInterval(() => {
      const before = this.trail.length;
      this.trail.age(performance.now());
      if (this.trail.length !== before) this.touch();
    }, AGES);
  }

  /**
   * The axes were read, J1 first; `null` if it is not known where they stand: then no arm is shown. `period`:
   * how often they are read, in milliseconds.
   */
  axes(values: readonly number[] | null, period: number): void {
    this.late.read(values, performance.now(), period);
    if (values === null) this.trail.gap();
    this.touch();
  }

  /** Whether what is shown is old: the arm is seen through then. */
  fade(isOld: boolean): void {
    this.arm.fade(isOld);
    this.touch();
  }

  /** A second arm, seen through: where a plan would have it; `null` takes it away. */
  ghost(values: readonly number[] | null): void {
    if (values !== null && this.ghostArm === null) {
      this.ghostArm = new Arm(this.model, this.colours, true);
      this.world.add(this.ghostArm.group);
    }
    if (this.ghostArm !== null) this.ghostArm.group.visible = values !== null;
    if (values !== null) this.ghostArm?.pose(values);
    this.touch();
  }

  /** The path that a plan would take; an empty list takes it away. */
  path(points: readonly PathPoint[]): void {
    this.points = points;
    this.planned.show(points, this.colours);
    this.touch();
  }

  /** The space that a guard leaves to the tool; `null` takes it away. */
  guard(box: Box | null): void {
    this.box = box;
    this.workspace.show(box, this.colours);
    this.touch();
  }

  /** The floor of a virtual robot is checkered, that of a real one has lines. Both have squares of 100 mm. */
  floor(isVirtual: boolean): void {
    this.isVirtual = isVirtual;
    clear(this.ground);
    this.ground = groundOf(this.model, isVirtual, this.colours);
    this.world.add(this.ground);
    this.touch();
  }

  view(name: ViewName): void {
    this.orbit.view(name, this.standing?.tool.at ?? null);
    this.touch();
  }

  /** Turns the view, in radians. */
  turn(left: number, up: number): void {
    this.orbit.turn(left, up);
    this.touch();
  }

  zoom(factor: number): void {
    this.orbit.zoom(factor);
    this.touch();
  }

  /** Reads the colours of the page again: the theme was changed. */
  recolour(): void {
    this.colours = coloursOf(this.canvas);
    this.world.background = new Color(this.colours.page);
    this.arm.colour(this.colours);
    this.ghostArm?.colour(this.colours);
    this.trail.colour(this.colours);
    for (const frame of this.frames) frame.colour(this.colours);
    this.floor(this.isVirtual);
    this.path(this.points);
    this.guard(this.box);
  }

  dispose(): void {
    this.isOver = true;
    if (this.scheduled !== null) cancelAnimationFrame(this.scheduled);
    clearInterval(this.ages);
    this.watched.disconnect();
    clear(this.ground);
    for (const one of [this.arm, this.ghostArm, this.trail, this.planned, this.workspace, ...this.frames]) one?.dispose();
    this.renderer.dispose();
    // A browser has few contexts: this one is not kept until somebody collects the garbage.
    this.context.getExtension("WEBGL_lose_context")?.loseContext();
  }

  private resize(): void {
    const { clientWidth, clientHeight } = this.canvas;
    if (clientWidth === 0 || clientHeight === 0) return;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, MOST_PIXELS));
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.camera.aspect = clientWidth / clientHeight;
    // What is narrower than high shows as much from side to side as it else shows from top to bottom.
    this.camera.fov = this.camera.aspect >= 1 ? LENS : (2 * Math.atan(Math.tan((LENS * Math.PI) / 360) / this.camera.aspect) * 180) / Math.PI;
    this.touch();
  }

  private touch(): void {
    if (this.isOver) return;
    this.scheduled ??= requestAnimationFrame(() => {
      this.scheduled = null;
      this.draw();
    });
  }

  private draw(): void {
    const now = performance.now();
    const axes = this.late.at(now);
    this.arm.group.visible = axes !== null;
    const [base, tool] = this.frames;
    if (base !== undefined) place(base.group, ORIGIN);
    if (tool !== undefined) tool.group.visible = axes !== null;
    this.standing = axes === null ? null : this.arm.pose(axes);
    if (this.standing !== null) {
      if (tool !== undefined) place(tool.group, this.standing.tool);
      this.trail.add(this.standing.tool.at, now);
      if (this.orbit.follows) this.orbit.target = this.standing.tool.at;
    }
    this.look();
    this.renderer.render(this.world, this.camera);
    // For tests, and for people who look for what is slow.
    this.canvas.dataset["drawn"] = String(Number(this.canvas.dataset["drawn"] ?? 0) + 1);
    this.canvas.dataset["triangles"] = String(this.renderer.info.render.triangles);
    if (!this.late.isAt(now)) this.touch();
  }

  private look(): void {
    const { eye, target, distance } = this.orbit;
    this.camera.position.set(...eye);
    this.camera.lookAt(...target);
    this.camera.near = distance / 100;
    this.camera.far = distance * 10;
    this.camera.updateProjectionMatrix();
    // The light comes from above the left shoulder of the person who looks.
    this.sun.position.set(eye[0] + 0.4 * (eye[1] - target[1]), eye[1] - 0.4 * (eye[0] - target[0]), eye[2] + distance * 0.6);
  }
}

/** A coordinate system: three lines with their letters. */
class Frames {
  readonly group = new Group();
  private readonly lines: LineSegments<BufferGeometry, LineBasicMaterial>;
  private letters: Sprite[] = [];

  constructor(private readonly length: number) {
    const ends = [0, 0, 0, length, 0, 0, 0, 0, 0, 0, length, 0, 0, 0, 0, 0, 0, length];
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(new Float32Array(ends), 3));
    this.lines = new LineSegments(geometry, new LineBasicMaterial({ depthTest: false }));
    this.lines.renderOrder = 1;
    this.group.add(this.lines);
  }

  colour(colours: Colours): void {
    this.lines.material.color.set(colours.text);
    this.clearLetters();
    this.letters = ["X", "Y", "Z"].map((letter, at) => {
      const map = textTexture(letter, colours.text);
      const sprite = new Sprite(new SpriteMaterial({ map, depthTest: false }));
      sprite.renderOrder = 1;
      sprite.scale.setScalar(this.length * 0.3);
      sprite.position.setComponent(at, this.length * 1.15);
      this.group.add(sprite);
      return sprite;
    });
  }

  dispose(): void {
    this.clearLetters();
    this.lines.geometry.dispose();
    this.lines.material.dispose();
  }

  private clearLetters(): void {
    for (const sprite of this.letters.splice(0)) {
      this.group.remove(sprite);
      sprite.material.map?.dispose();
      sprite.material.dispose();
    }
  }
}

function textTexture(text: string, colour: string): CanvasTexture {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 64;
  const context = canvas.getContext("2d");
  if (context !== null) {
    context.font = "600 52px sans-serif";
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.fillStyle = colour;
    context.fillText(text, 32, 36);
  }
  const texture = new CanvasTexture(canvas);
  texture.colorSpace = SRGBColorSpace;
  return texture;
}

/** The floor under all that the arm can reach, in whole squares of the grid. */
function groundOf(model: ArmModel, isVirtual: boolean, colours: Colours): Group {
  const [low, high] = spaceOf(model);
  const down = (mm: number): number => (Math.floor(mm / GRID) - 1) * GRID;
  const up = (mm: number): number => (Math.ceil(mm / GRID) + 1) * GRID;
  const [x0, x1, y0, y1] = [down(low[0]), up(high[0]), down(low[1]), up(high[1])];
  const level = floorOf(model);
  const group = new Group();
  if (isVirtual) {
    const plane = new PlaneGeometry(x1 - x0, y1 - y0).translate((x0 + x1) / 2, (y0 + y1) / 2, level - 1);
    const map = checkers(colours.virtual, colours.page);
    map.repeat.set((x1 - x0) / (2 * GRID), (y1 - y0) / (2 * GRID));
    group.add(new Mesh(plane, new MeshBasicMaterial({ map, side: DoubleSide })));
    return group;
  }
  const ends: number[] = [];
  for (let x = x0; x <= x1; x += GRID) ends.push(x, y0, level, x, y1, level);
  for (let y = y0; y <= y1; y += GRID) ends.push(x0, y, level, x1, y, level);
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(ends), 3));
  group.add(new LineSegments(geometry, new LineBasicMaterial({ color: colours.line })));
  return group;
}

function checkers(one: string, other: string): CanvasTexture {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 2;
  const context = canvas.getContext("2d");
  if (context !== null) {
    context.fillStyle = one;
    context.fillRect(0, 0, 2, 2);
    context.fillStyle = other;
    context.fillRect(0, 0, 1, 1);
    context.fillRect(1, 1, 1, 1);
  }
  const texture = new CanvasTexture(canvas);
  texture.colorSpace = SRGBColorSpace;
  texture.magFilter = NearestFilter;
  texture.wrapS = texture.wrapT = RepeatWrapping;
  return texture;
}

/** Takes away all that is in a group, and what it holds of the graphics card. */
function clear(group: Group): void {
  group.removeFromParent();
  group.traverse((one) => {
    if (!(one instanceof Mesh || one instanceof LineSegments)) return;
    one.geometry.dispose();
    const material = one.material as MeshBasicMaterial;
    material.map?.dispose();
    material.dispose();
  });
}
