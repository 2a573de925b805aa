/** The history in Chinese. */
import type { HistoryEvent } from "../../api/types.ts";
import type { choice as englishChoice, history as english } from "../en/history.ts";
import { codeText } from "./codes.ts";
import { duration } from "./say.ts";

const BECAUSE: Record<string, string> = {
  link: "连接断开或没有数据",
  late: "网关过慢或主机曾休眠",
  start: "网关启动或机器人配置已更改",
  lost: "数值无法保存",
  unread: "机器人的应答中没有此值",
  another_robot: "应答的是另一台机器人",
};

const KINDS: Record<string, string> = {
  main: "除循环和产量外的全部",
  alarms: "报警",
  links: "连接与未看到的时间",
  cycles: "循环和产量",
  all: "全部",
};

function event(of: HistoryEvent, mode: (number: number) => string, time: (at: string, from?: string | null) => string): string {
  switch (of.event) {
    case "alarm_began":
      return `报警 ${of.code} 开始：${codeText(of.code, of.text)}`;
    case "alarm_ended":
      return `报警 ${of.code} 结束${of.lasted_ms === null ? "" : `，持续 ${duration(of.lasted_ms / 1000)}`}：${codeText(of.code, of.text)}`;
    case "mode_changed":
      return `模式：${mode(of.from)} → ${mode(of.to)}`;
    case "program_changed":
      return `程序：${of.from || "未命名"} → ${of.to || "未命名"}`;
    case "cycle_done":
      return `${of.at_least ? "至少" : ""}完成 ${of.count} 个循环${of.ms === null ? "" : `，${(of.ms / 1000).toFixed(2)} 秒`}`;
    case "parts":
      return `产量增加 ${of.added}，累计 ${of.total}（${of.counter}）`;
    case "parts_reset":
      return `产量计数器从 ${of.from} 变为 ${of.to}（${of.counter}）`;
    case "link_lost":
      return "连接断开";
    case "link_back":
      return "连接恢复";
    case "unseen":
      return `未看到：${of.from === null ? "" : `自 ${time(of.from)} `}至 ${time(of.to, of.from)}，${BECAUSE[of.because] ?? of.because}`;
    default:
      return of.event;
  }
}

export const history: typeof english = {
  choose: "显示内容",
  robots: "机器人",
  signals: "信号",
  empty: "请选择机器人和信号。",
  noSignals: "请选择信号。",
  noRobots: "还没有机器人。管理员可在“连接”页面添加，或写入网关的配置文件。",
  most: (n) => `最多 ${n} 台机器人。`,
  missing: (robot) => `${robot} 不存在，或您无权查看。`,
  charts: (robot) => `${robot} 的曲线`,
  happened: "发生的事件",
  kinds: (kind) => KINDS[kind] ?? kind,
  show: "显示",
  event,
  time: "时间",
  robot: "机器人",
  what: "事件",
  noEvents: "此时间范围内没有看到此类事件。",
  more: "还有更多事件，请选择较短的时间范围或某一类事件。",
  moreRows: (n) => `再显示 ${n} 条`,
  rows: (shown, all) => `共 ${all} 条，显示最近 ${shown} 条`,
  again: "重新读取",
  reading: "正在读取事件…",
  eventsOf: (robot) => `${robot} 的事件`,
  unreadable: (n) => `历史中有 ${n} 段数据无法读取，未显示。`,
  exports: "文件",
  exportHint: "文件中的时间为 UTC。",
  values: "数值",
  each: "每个保存的数值",
  averages: (text) => `${text}平均值`,
  widths: (width) => ({ "1s": "1 秒", "1m": "1 分钟", "1h": "1 小时" })[width] ?? width,
  fileOf: (what, kind) => `${what} ${kind}`,
  events: "事件",
  progress: (name, pages) => `${name}：${pages} 部分…`,
  saved: (names) => `已保存为 ${names}。`,
  cut: (name) => `${name} 只包含时间范围的开头：数据过多。其余部分请选择较短的时间范围。`,
};

export const choice: typeof englishChoice = {
  add: "添加…",
  remove: (name) => `移除 ${name}`,
  clear: "全部移除",
};
