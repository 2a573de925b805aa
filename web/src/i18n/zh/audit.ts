/** Words of the audit log. */
import { who } from "./say.ts";
import type { audit as english } from "../en/audit.ts";
import { rights } from "./rights.ts";

/** Which gateway, if several share a database. */
const at = ({ url }: { url: string | null }): string => (url === null ? "" : ` ${url} `);

const CAUSES: Record<string, string> = {
  released: "已归还",
  expired: "未续期",
  taken: "被管理员接管",
  identity_changed: "应答的是另一台机器人",
  reconfigured: "机器人配置已更改",
  removed: "机器人已移除",
  gateway_ended: "网关已退出",
};

export const audit: typeof english = {
  filters: "筛选",
  robot: "机器人",
  who: "人员或令牌",
  whoHint: "输入名称的一部分即可。",
  kind: "类型",
  from: "从",
  to: "到",
  hallTime: "车间时间",
  badTime: "时间无效。",
  all: "全部",
  clear: "清除筛选",
  kinds: {
    stop: "停止",
    refused: "被拒绝",
    command: "命令",
    run: "程序运行",
    lease: "控制权",
    alarm: "报警确认与搁置",
    sign_in: "登录与退出",
    people: "用户与令牌",
    robot: "机器人配置",
    program: "已保存的程序",
    settings: "设置与规则",
    gateway: "网关自身",
  },
  entries: "记录（最新在前）",
  time: "时间",
  actor: "操作者",
  source: "地址",
  what: "内容",
  number: "记录号",
  none: "没有符合条件的记录。",
  noneNext: "请清除某个筛选条件或选择更长的时间段。读取操作和控制权续期不记入日志。",
  empty: "日志中没有您可查看的记录。",
  until: (number, at) => `已查找到记录 ${number}（${at}）。`,
  older: "更早的记录",
  searchOn: "继续查找",
  newest: "最新记录",
  fields: "所有字段",
  refused: "被拒绝",
  unseen: "未确认",
  gateway: "网关自身",
  shell: "网关上的命令行",
  link: "一次性链接",
  deed: (entry, command) => {
    switch (entry.what) {
      case "gateway_started":
        return `网关${at(entry)}启动。`;
      case "gateway_ended":
        return `网关${at(entry)}正常退出。`;
      case "restored":
        return "数据目录由备份恢复。每台机器人的停止均有效。";
      case "audit_key":
        return "此后日志链头用本网关现在的密钥签名。";
      case "token_made":
        return `生成令牌 ${entry.token}${entry.name === "" ? "" : `“${entry.name}”`}：${rights(entry.role, entry.only)}。`;
      case "token_revoked":
        return `吊销令牌 ${entry.token}。`;
      case "camera_granted":
        return `允许令牌 ${entry.token} 无需控制权即可为相机 ${entry.camera} 发送点位。`;
      case "camera_revoked":
        return `令牌 ${entry.token} 不再可以为相机 ${entry.camera} 发送点位。`;
      case "photo_answer":
        return `应答相机 ${entry.camera} 的拍照请求：${entry.taken ? "拍照成功" : "拍照失败"}。`;
      case "user_made":
        return `新建用户 ${entry.user}：${rights(entry.role, entry.only)}${entry.disabled ? "，已停用" : ""}。`;
      case "user_changed":
        return `更改用户 ${entry.user}：${rights(entry.role, entry.only)}${entry.disabled ? "，已停用" : ""}${entry.new_password ? "，更换密码" : ""}。`;
      case "user_removed":
        return `删除用户 ${entry.user}。`;
      case "link_made":
        return entry.user === null ? "生成首个管理员的一次性链接。" : `为 ${entry.user} 生成一次性链接。`;
      case "signed_in":
        return "登录。";
      case "signed_out":
        return "退出登录。";
      case "sign_in_failed":
        return `以 ${entry.user} 登录失败 ${entry.times} 次。`;
      case "lease_began":
        return entry.taken_because === null ? "取得控制权。" : `从他人处接管控制权，原因：“${entry.taken_because}”。`;
      case "lease_ended":
        return `${entry.holder ? `${who(entry.holder)} 的` : ""}控制权结束：${CAUSES[entry.cause] ?? entry.cause}。`;
      case "command_intent":
        return `将发送命令 ${entry.command}。`;
      case "command_outcome":
        return `命令${command === undefined ? `（记录 ${entry.intent}）` : ` ${command} `}${
          { accepted: "已被控制器接受。", refused: "被拒绝。", not_sent: "未发送。", unknown: "已发出，结果未知。" }[entry.outcome]
        }`;
      case "run_intent":
        return `运行${entry.program === null ? "程序" : ` ${entry.program}${entry.version === null ? "" : ` 版本 ${entry.version}`}`}：${entry.steps} 步，${entry.repeat} 次。`;
      case "run_outcome":
        return `运行 ${entry.run} ${
          {
            running: "正在进行",
            done: "已完成",
            stopped: "已停止",
            refused: "被拒绝",
            failed: "失败",
            unknown: "已结束，实际执行情况未知",
          }[entry.state]
        }；已见完成 ${entry.done} 步（${entry.because}）。`;
      case "refused":
        return `${entry.request}：被拒绝（${entry.code}）。`;
      case "stop_began":
        return entry.request === "stop" ? "请求停止。" : `通过 ${entry.request} 请求停止。`;
      case "stop":
        if (!entry.confirmed) return entry.request === "stop" ? "停止：未确认。" : `通过 ${entry.request} 停止：未确认。`;
        return entry.request === "stop"
          ? "已停止，已确认机械臂静止。"
          : `通过 ${entry.request} 停止：已被接受，未查看机械臂是否静止。`;
      case "stop_cleared":
        return "解除停止。";
      case "owed_stop_forgotten":
        return `声明机械臂已不在，其运行留下的指令列表不再被停止，原因：“${entry.because}”。`;
      case "identity_changed":
        return `应答的是另一台机器人：${entry.found.machine_name ?? "?"}，而不是 ${entry.expected.machine_name ?? "?"}。`;
      case "identity_accepted":
        return `确认当前应答的机器人：${entry.identity.machine_name ?? "?"}。`;
      case "robot_configured":
        return `添加或更改机器人：${entry.address}，每 ${entry.period_ms} ms 读取一次。`;
      case "robot_removed":
        return "移除机器人。";
      case "alarm_acknowledged":
        return `确认报警 ${entry.code}${entry.comment ? `：“${entry.comment}”` : ""}。`;
      case "alarm_shelved":
        return `搁置报警 ${entry.code}，原因：“${entry.reason}”。`;
      case "alarm_unshelved":
        return `取消搁置报警 ${entry.code}。`;
      case "raw_rules":
        return `此后原始端口有 ${entry.rules.length + entry.more} 条规则。`;
      case "raw_ports":
        return entry.open ? "开放原始端口。" : "关闭所有原始端口。";
      case "settings_changed":
        return `更改车间设置：${entry.time_zone}，${entry.shifts.length} 个班次。`;
      case "program_stored":
        return `保存程序 ${entry.program}，版本 ${entry.version}。`;
      case "program_removed":
        return `删除程序 ${entry.program}。`;
      case "point_stored":
        return `保存点位 ${entry.point}，版本 ${entry.version}。`;
      case "point_removed":
        return `删除点位 ${entry.point}。`;
    }
  },
  chain: "日志是否完整？",
  chainWhat:
    "每条记录都带有对自身和前一条记录计算的哈希值。网关对日志末尾（链头）签名。页面只能看到网关发送的内容，因此无法证明日志完整。",
  head: "立即对日志末尾签名",
  headWhat: "请将此链头保存在另一台机器上，日后可证明该记录之前的内容未被截断或改写。",
  headNumber: "最后一条记录",
  headTime: "签名时间",
  headHash: "哈希值",
  headKey: "密钥",
  save: "保存为文件",
  verify: "要检查每条记录，请在网关上运行以下命令，并使用保存在别处的链头和密钥：",
  kept: "比对已保存的链头",
  keptHint: "在此保存的文件内容，或从 /v1/audit/head 取得的内容。",
  compare: "比对",
  noHead: "这不是链头：缺少记录号和哈希值。",
  same: (number) => `网关给出的记录 ${number} 的哈希值相同。如网关所言属实，此前的内容未被改写。请用 r6 gateway verify 检查。`,
  other: (number) =>
    `记录 ${number} 的哈希值已不同。日志被改写，或此链头属于另一个网关。请保留数据目录，并运行 r6 gateway verify。`,
  gone: (number) => `记录 ${number} 不存在，或您无权查看。可能是日志被截断，或该记录已过期移除。`,
};
