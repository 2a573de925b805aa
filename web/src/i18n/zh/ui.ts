/** Words of the parts that pages share. */
import type { Role } from "../../api/types.ts";
import type { ui as english } from "../en/ui.ts";

const ROLES: Record<Role, string> = { viewer: "观察员", operator: "操作员", engineer: "工程师", admin: "管理员" };

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
  asOf: (at) => `数据截至 ${at}，之后可能已变化。`,
  problem: (code) => {
    switch (code) {
      case "no_answer":
        return "网关没有应答。";
      case "not_allowed":
        return "您没有执行此操作的权限。";
      case "no_session":
      case "no_token":
        return "您已退出登录。";
      case "too_many_requests":
        return "请求过于频繁。";
      case "overloaded":
        return "网关负荷过高。";
      case "store_unavailable":
        return "网关无法使用其磁盘。";
      case "outcome_unknown":
        return "是否已执行未知。";
      case "managed_by_file":
        return "该项由网关的配置文件管理，不能在此更改。";
      case "not_this_version":
        return "其间已被他人更改。";
      case "bad_value":
      case "bad_body":
        return "填写的值不允许。";
      case "no_such_robot":
        return "没有这台机器人。";
      case "stopped":
        return "该机器人的停止仍然有效。";
      case "address_taken":
        return "该地址已被另一台机器人使用。";
      case "name_taken":
        return "该名称已被使用。";
      case "last_admin":
        return "这是最后一个可以登录的管理员。";
      case "wrong_password":
        return "密码错误。";
      case "link_void":
        return "链接已失效。";
      case "no_room":
        return "数量已达上限。";
      case "no_such_user":
        return "没有这个用户。";
      case "no_such_token":
        return "没有这个令牌。";
      default:
        return "网关拒绝了该请求。";
    }
  },
  next: (code) => {
    switch (code) {
      case "no_answer":
        return "请检查网关是否在运行，以及本设备的网络连接。";
      case "not_allowed":
        return "请向管理员申请相应角色。";
      case "no_session":
      case "no_token":
        return "请重新登录。";
      case "too_many_requests":
      case "overloaded":
        return "请稍候。";
      case "store_unavailable":
        return "请检查网关的磁盘：是否已满、是否仍在。";
      case "outcome_unknown":
        return "再次操作之前，请先查看当前状态。";
      case "managed_by_file":
        return "请修改配置文件。作为服务运行的网关收到 SIGHUP 后重新读取；`r6 up` 须重新启动。";
      case "not_this_version":
        return "请先查看当前值，再重新更改。";
      case "last_admin":
        return "请先添加另一个管理员。";
      case "stopped":
        return "请先查看机器人并解除停止。";
      case "link_void":
        return "请向管理员索取新的链接。";
      default:
        return "";
    }
  },
  said: "网关消息：",
  needsRole: (role, ofAll) =>
    `需要${ofAll ? "面向所有机器人的" : ""}“${ROLES[role]}”${role === "admin" ? "" : "或更高"}角色。`,
  haveRole: (role, robot) => `您当前的角色是“${ROLES[role]}”${robot === null ? "" : `，仅限 ${robot}`}。请联系管理员。`,
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
  required: "必填",
};
