/** Why something cannot be done now. */
import type { Unmet } from "../../robots/sentence.ts";

export const UNMET: Record<Unmet, string> = {
  gateway_lost: "收不到网关的消息，或消息过迟",
  no_right: "需要操作员权限",
  no_link: "与机器人没有连接",
  other_robot: "应答的是另一台机器人，须由工程师确认",
  no_lease: "请先获取控制权",
  unanswered: "网关正在等待机器人的应答：请稍候再试",
  stale: "其状态已过时",
  manual: "手动模式：由示教器操作",
  mode_stop: "请先在示教器上将钥匙转到自动",
  alarm: "请先清除报警",
  no_alarm: "没有报警",
  stop_holds: "请先解除停止",
  no_stop: "没有生效的停止",
  running: "已在运行",
  not_running: "未在运行",
};
