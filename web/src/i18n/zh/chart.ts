/** Charts and spans in Chinese. */
import type { chart as english } from "../en/chart.ts";

const SPANS = { "1m": "1 分钟", "15m": "15 分钟", "8h": "8 小时", "7d": "7 天", "1y": "1 年" };

export const chart: typeof english = {
  title: "曲线",
  span: "时间范围",
  spans: (span) => SPANS[span],
  own: "自定义范围…",
  from: "起",
  to: "止",
  show: "显示",
  zone: (zone) => `车间时间（${zone}）`,
  wrong: "结束时间必须晚于开始时间，范围最长十年。",
  canvas: (robot, names) => `${robot} 的曲线：${names}。下方表格内容相同。`,
  hint: "线：平均值。色带：最小值到最大值。线中断处：没有数值。",
  gap: "无数值",
  noNumber: "非数字",
  part: (percent) => (percent < 1 ? "不到 1 % 有数值" : `${percent} % 有数值`),
  reading: (done, all) => `正在读取历史… ${done}/${all}`,
  empty: "此时间范围内没有保存的数值。请选择其他范围或其他信号。",
  first: (at) => `此范围内 ${at} 之前没有数值。`,
  unreadable: (n) => `历史中有 ${n} 段数据无法读取，未显示。`,
  averages: (minutes, lacks) =>
    `原始数据已删除，仅保留 ${minutes < 60 ? `${minutes} 分钟` : `${minutes / 60} 小时`} 的平均值。${lacks ? "其中缺少部分数据。" : ""}`,
  tooMuch: "数据量超出本页读取范围，请选择较短的时间范围。",
  table: "以表格显示",
  time: "起始时间",
  whole: "整个范围",
  legend: "有数值期间的平均值（最小 … 最大）。“40 % 有数值”：仅该部分时间有数值。",
  more: "在历史页面查看更多信号和机器人",
};
