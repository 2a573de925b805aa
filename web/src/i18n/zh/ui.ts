/** Words of the parts that pages share. */
import type { ui as english } from "../en/ui.ts";
import { refusalOf } from "./refusals.ts";
import { ROLES, rights, robotsOf } from "./rights.ts";

export const ui: typeof english = {
  newBuild: "网关上有此页面的其他版本。重新加载时，尚未保存的输入将丢失。",
  part: {
    failed: "无法加载页面的这一部分。",
    why: (found) =>
      ({
        away: "网关没有应答。收到网关的消息后会再次询问。",
        same: "网关现在有应答。",
        other: "网关上是此页面的其他版本，当前版本的各部分已不在。",
      })[found],
  },
  loading: "正在加载…",
  again: "重试",
  lacks: { longer: "请按住 1 秒。", again: "请再按一次。" },
  asOf: (at) => `数据截至 ${at}，之后可能已变化。`,
  problem: (code) => refusalOf(code)[0],
  next: (code) => refusalOf(code)[1],
  refusal: ({ code }) => refusalOf(code).join(""),
  original: "网关原文（英文）",
  said: "网关消息：",
  needsRole: (role, ofAll) =>
    `需要${ofAll ? "面向所有机器人的" : ""}“${ROLES[role]}”${role === "admin" ? "" : "或更高"}角色。`,
  haveRole: (role, robot) => `您当前的角色是“${robot === null ? ROLES[role] : rights(role, robot)}”。请联系管理员。`,
  scrolls: "旁边还有内容：请左右滑动，或使用方向键。↔",
  details: "详情",
  copy: "复制",
  copied: "已复制",
  copyFailed: "无法复制，请手动选中并复制。",
  once: "仅显示这一次，网关无法再次显示。",
  close: "关闭",
  cancel: "取消",
  save: "保存",
  sending: "正在发送…",
  saving: "正在保存…",
  saved: "已保存。",
  done: "已完成。",
  yes: "是",
  no: "否",
  allRobots: "所有机器人",
  robots: robotsOf,
  required: "必填",
};
