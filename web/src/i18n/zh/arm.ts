/** The picture of an arm. */
import type { arm as english } from "../en/arm.ts";
import { duration } from "./say.ts";

export const arm: typeof english = {
  title: "机械臂",
  label: (name) => `${name} 机械臂的图形，与各轴表格内容一致。可用方向键转动视角。`,
  view: "视角",
  views: { iso: "轴测", top: "俯视", side: "侧视", tool: "工具" },
  nearer: "放大",
  farther: "缩小",
  squares: "方格边长 100 mm。弧线为软限位，细线为工具最近一分钟的轨迹。",
  turn: "拖动可转动视角；触摸屏请用两根手指。",
  loading: "正在加载图形…",
  notKnown: "机械臂的位置未知。",
  old: (seconds) => `${duration(seconds)}前`,
  graphics: "此浏览器无法显示三维图形：没有 WebGL 或已停用。请看数值，内容一致。",
  lost: "图形已丢失：显卡被重置或过于繁忙。请看数值，内容一致。",
  again: "重新显示",
  modelsFailed: "无法读取机械臂型号。",
  unknownModel: (model) => `此网关不认识型号 ${model}，只显示数值。`,
  noModel: "尚未配置该机械臂的型号，控制器也不提供型号，因此只显示数值。",
  byFile: "该机器人由网关的配置文件管理：请在文件中填写型号，然后重新读取文件。",
  needsAdmin: "型号可由管理员选择。",
  choose: "机械臂型号",
  none: "请选择型号…",
  set: (robot) => `设定 ${robot} 的型号`,
  setWarning: "机器人将重新连接，其控制权结束。网关正在其上运行的程序会先被停止。",
  setting: "正在设定型号…",
};
