/** Words of the connections: robot, network or gateway, which is at fault. */
import type { connections as english } from "../en/connections.ts";

function few(robots: readonly string[]): string {
  return robots.length <= 5 ? robots.join("、") : `${robots.slice(0, 5).join("、")} 等 ${robots.length} 台`;
}

export const connections: typeof english = {
  title: "故障在哪里？",
  fault: (fault) => {
    switch (fault.kind) {
      case "none":
        return "未发现故障：能收到网关的消息，每台机器人都应答网关。";
      case "no_robot":
        return "网关没有您可查看的机器人。";
      case "gateway":
        return "本页收不到网关的消息。请检查网关，以及网关与本设备之间的网络。机器人的状况在此未知。";
      case "all":
        return `${fault.robots.length} 台机器人均未应答网关。请先检查网关的网络：网线、交换机和地址。`;
      case "some":
        return `其他机器人应答网关，以下没有应答：${few(fault.robots)}。请检查${fault.robots.length === 1 ? "该机器人及其网线和地址" : "这些机器人及其网线、交换机和地址"}。`;
      case "only":
        return `${few(fault.robots)} 没有应答网关。这是唯一的机器人，从这里无法判断是机器人还是网络的故障，请两者都检查。`;
    }
  },
  page: "本页到网关",
  heard: (ms) => (ms === null ? "正常" : `正常，往返 ${ms} ms`),
  notHeard: "收不到消息",
  connecting: "正在连接",
  store: "网关的磁盘",
  storeOk: "可写入",
  storeBad: "无法写入：命令被拒绝，停止仍可用",
  history: "历史数据",
  historyIs: { kept: "正在保存", paused: "已暂停：磁盘无法写入样本", off: "已关闭" },
  historySize: (mb) => `占用磁盘 ${mb} MB`,
  certificate: "证书到期",
  robotsUp: "已连接的机器人",
  upOf: (up, all) => `${up} / ${all}`,
  robots: "机器人",
  none: "还没有机器人。面向所有机器人的管理员可在下方添加，或写入网关的配置文件。",
  robot: "机器人",
  link: "连接",
  up: "正常",
  down: "无连接",
  unknown: "未知",
  since: "开始时间",
  sinceIs: (since, at) =>
    ({ unknown: "未知", at, at_least: `${at} 或更早`, no_change: "在已保存的最近 24 小时记录中没有变化" })[since.kind],
  losses: "24 小时内断开次数",
  timeouts: "无应答",
  timeoutsOf: (timeouts, requests) => `${timeouts} / ${requests}`,
  reconnects: "重连次数",
  countedSince: "计数从网关启动、机器人添加或更改时开始。网关不提供应答所需的时间。",
  machine: "机器名称与固件",
  every: "读取间隔",
  details: "详情",
  address: "地址",
  axes: "轴数",
  model: "型号",
  managed: "管理方式",
  managedBy: { file: "网关的配置文件或命令行，请在那里更改", api: "本页和 API" },
  twin: "孪生",
  twinOf: "所孪生的机器人",
  raw: "原始端口的客户端",
  rawRefused: "以 err 应答的原始请求",
  rawClosed: "被关闭的原始客户端",
  lost: "丢失的样本",
  waiting: "等待写入磁盘的记录",
  replies: "应答",
  read: "额外读取的地址",
  events: "最近 24 小时的连接",
  noEvents: "没有断开，也没有恢复。",
  event: { link_lost: "断开", link_back: "恢复" },
  changed: (robot) => `${robot}：该地址上应答的是另一台机器人`,
  changedWhat: "在工程师确认之前，命令将被拒绝。",
  expected: "原来的机器人",
  found: "现在应答的机器人",
  firmware: "固件",
  name: "机器名称",
  accept: "确认现在应答的机器人…",
  acceptTitle: (robot) => `此后它就是 ${robot} 吗？`,
  acceptWhat: "请站到机器旁，将其名称和固件与此处显示的内容核对。此后发给该名称的命令和程序都会发给这台机器。",
  acceptVoid: "未确认：显示的内容与现在应答的机器人不符，或收不到网关的消息。请重新查看。",
  acceptNow: "确认",
  didAccept: (robot) => `确认应答的机器人为 ${robot}`,
  add: "添加机器人",
  addHint: "可用 a 至 z、数字和 -，最多 32 个字符",
  badName: "该名称不允许。",
  nameTaken: "该名称的机器人已存在，请在列表中更改。",
  addressHint: "主机；端口不是 9760 时请注明；或 listen:ADDR:PORT,from:ADDR",
  period: "读取间隔（ms）",
  periodHint: "20 至 3600000",
  badPeriod: "请填写 20 至 3600000 之间的数字。",
  readHint: "查询地址，用逗号分隔，例如 Addr-800, counter-0。第一个计数器用于计件。",
  modelHint: "例如 BRTIRUS0707A，用于图形、规划和限位。不清楚时请留空。",
  didAdd: (robot) => `添加 ${robot}`,
  change: "更改…",
  changeTitle: (robot) => `更改 ${robot}`,
  changeWhat: "机器人将重新连接，其控制权结束。正在运行的程序会先被停止。",
  readDerived: "该列表由目前读取的数值得出，请核对。",
  didChange: (robot) => `更改 ${robot}`,
  remove: "移除…",
  removeTitle: (robot) => `移除 ${robot}？`,
  removeWhat: "其控制权结束，机械臂继续当前动作。由网关运行的程序会先被停止。停止仍然有效的机器人不会被移除。",
  didRemove: (robot) => `移除 ${robot}`,
  needsAdmin: "由面向所有机器人的管理员添加和移除机器人。",
};
