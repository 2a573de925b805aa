/** The page of a robot: what a person does there. */
import type { controls as english } from "../en/controls.ts";

export const controls: typeof english = {
  parts: "本页各部分",
  tabs: { live: "实时", axes: "各轴", io: "输入/输出", more: "更多" },
};
