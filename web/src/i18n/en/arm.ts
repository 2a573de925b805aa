/** The picture of an arm. */
import { duration } from "./say.ts";

export const arm = {
  title: "Arm",
  label: (name: string) => `Picture of the arm of ${name}. The table of the axes says the same. Arrow keys turn it.`,
  view: "View",
  views: { iso: "Iso", top: "Top", side: "Side", tool: "Tool" },
  nearer: "Nearer",
  farther: "Farther away",
  squares: "Squares of 100 mm. Arcs are soft limits. The line is the tool's way of the last minute.",
  turn: "Drag it to turn it; with a finger, use two.",
  loading: "Loading the picture…",
  notKnown: "Where the arm stands is not known.",
  old: (seconds: number) => `${duration(seconds)} old`,
  graphics: "This browser draws no 3D here: WebGL is missing or switched off. The numbers say the same.",
  lost: "The picture was lost: the graphics card was reset or is too busy. The numbers say the same.",
  again: "Show it again",
  modelsFailed: "The models of arms cannot be read.",
  unknownModel: (model: string) => `This gateway does not know the model ${model}: there are numbers only.`,
  noModel: "The model of this arm is not configured, and the controller does not tell it: there are numbers only.",
  byFile: "This robot is configured in the file of the gateway: write its model there, then load the file again.",
  needsAdmin: "An admin can choose the model.",
  choose: "Model of the arm",
  none: "Choose a model…",
  set: (robot: string) => `Set the model of ${robot}`,
  setWarning:
    "The robot gets a new connection, and its lease ends. A program that the gateway runs on it is stopped first.",
  setting: "Setting the model…",
  guard: "Limits of lists",
  guardMeans:
    "The gateway sends no run and no list of a script with a step beyond these. They compare numbers, and protect no people.",
  guardBox: "The dashed box is the workspace without a work frame; in a work frame it is elsewhere.",
  limits: {
    range: (of: string, lowest: number, highest: number, unit: string) => `${of}: ${lowest} to ${highest} ${unit}`,
    speed: (percent: number) => `Speed of a move: ${percent} % at most, before the global speed`,
    pathSpeed: (speed: number) => `Path speed: ${speed} mm/s at most`,
    axisStep: (degrees: number) => `One axis move turns an axis by ${degrees}° at most`,
    distance: (mm: number) => `One move of the tool goes ${mm} mm at most`,
  },
};
