/** The words of the page in Simplified Chinese. */
import type { en } from "./en.ts";
import { account } from "./zh/account.ts";
import { connections } from "./zh/connections.ts";
import { arm } from "./zh/arm.ts";
import { controls } from "./zh/controls.ts";
import { faults } from "./zh/faults.ts";
import { alarms } from "./zh/alarms.ts";
import { chart } from "./zh/chart.ts";
import { codeText } from "./zh/codes.ts";
import { choice, history } from "./zh/history.ts";
import { menu } from "./zh/menu.ts";
import { run } from "./zh/run.ts";
import { teach } from "./zh/teach.ts";
import { production } from "./zh/production.ts";
import { refusalOf } from "./zh/refusals.ts";
import { duration, who } from "./zh/say.ts";
import { hallSettings } from "./zh/settings.ts";
import { ROLES } from "./zh/rights.ts";
import { ui } from "./zh/ui.ts";
import { UNMET } from "./zh/unmet.ts";

const MODES: Record<number, string> = {
  0: "无模式",
  1: "手动",
  2: "待机",
  3: "已停止",
  7: "运行中",
  8: "单步",
  9: "单循环",
};

function named(program: string | null): string {
  return program === null ? "" : ` ${program} `;
}

function listOf(left: number | null): string {
  return left === null || left === 0 ? "" : `，列表中还有 ${left} 条指令`;
}

export const zh: typeof en = {
  code: "zh-Hans",
  name: "简体中文",
  menu,
  ui,
  account,
  connections,
  hallSettings,
  arm,
  controls,
  run,
  faults,
  teach,
  alarms,
  chart,
  choice,
  history,
  production,
  hall: "车间",
  toHall: "返回车间",
  main: "主要内容",
  language: "语言",
  theme: "配色",
  themes: { system: "跟随系统", light: "浅色", dark: "深色" },
  signIn: {
    title: "登录",
    name: "用户名",
    password: "密码",
    token: "令牌",
    withPassword: "用户名和密码登录",
    withToken: "令牌登录",
    submit: "登录",
    working: "正在登录…",
    signOut: "退出登录",
    ended: "会话已结束，请重新登录。",
    maybeOpen: "网关未确认：会话可能仍然打开。请重试。",
    open: (who) => `此浏览器中已有打开的会话：${who}。`,
    linkOf: (who) => `地址中的链接将以其他身份登录：${who}。`,
    linkUnknown: "地址中的链接无效，或网关没有应答。",
    keep: (who) => `继续使用 ${who}`,
    replace: (who) => `结束该会话，并以 ${who} 登录`,
    hint: "命令 r6 up 会打印登录链接。命令 r6 gateway token 生成令牌，用户由管理员创建。",
    badLink: "地址中的链接没有有效的令牌。以前启动时的链接已失效。",
    problem: (code) =>
      code === "wrong_password"
        ? "用户名或密码错误，或该用户已被停用。"
        : code === "no_token"
          ? "令牌无效。"
          : code === "too_many_requests"
            ? "尝试次数过多，请稍候再试。"
            : code === "unknown"
              ? "网关没有应答，请重试。"
              : refusalOf(code).join(""),
  },
  role: (role) => ROLES[role],
  token: (number) => `令牌 ${number}`,
  gateway: {
    ms: (ms) => `网关 ${ms} ms`,
    connecting: "正在连接网关…",
    lost: (seconds) => `与网关失去连接已 ${duration(seconds)}。本页所有内容均已过时，正在重试…`,
    hangs: (seconds) =>
      `已有 ${duration(seconds)}没有收到网关的消息，而连接没有断开：网关或网络停滞。本页所有内容均已过时，正在重试…`,
    lostShort: "网关已断开",
    silent: "网关无响应",
    ageUnknown: "数值已过时多久尚不清楚",
    slow: (seconds) => `网关缓慢：数值最多已过时 ${Math.max(1, Math.ceil(seconds))} 秒`,
  },
  mode: (mode) => (mode === null ? "模式未知" : (MODES[mode] ?? `模式 ${mode}`)),
  zoneUnread: "尚不知道车间的时区，时间均为 UTC。",
  zoneUnknown: (zone) => `此浏览器不认识车间的时区 ${zone}，本页所有时间均为 UTC。`,
  virtual: "VIRTUAL 虚拟",
  real: "真实",
  kindUnknown: "类型未知",
  counts: {
    need: (n) => (n === 0 ? "没有机器人需要处理" : `${n} 台需要处理`),
    unknown: (n) => `${n} 台未知`,
    noLink: (n) => `${n} 台无连接`,
    run: (n) => `${n} 台运行`,
    rest: (n) => `${n} 台待机`,
    manual: (n) => `${n} 台手动`,
    twins: (n) => `${n} 台孪生机器人`,
  },
  needs: {
    title: "需要处理",
    none: "没有机器人需要处理。",
    old: "收不到网关的消息，现在哪些机器人需要处理未知。",
    unknown: (n) => `有 ${n} 台机器人是否需要处理未知：数值缺失、过时或读取间隔过长。`,
    waiting: (n) => `${n} 条新消息`,
    shelved: (n) => `${n} 条报警已搁置`,
    open: "打开",
    priority: (n) => (n === 1 ? "需要处理" : "受影响"),
    since: (seconds) => `已等待 ${duration(seconds)}`,
    cause: (cause, robots) => {
      switch (cause.kind) {
        case "alarm":
          return `报警 ${cause.code}${cause.text === null ? "" : `：${codeText(cause.code, cause.text)}`}`;
        case "other_robot":
          return "该地址上应答的是另一台机器人，须由工程师确认";
        case "no_link":
          return robots === 1 ? "连接丢失" : `连接丢失：${robots} 台机器人`;
        case "stop_holds":
          return `${cause.by === null ? "" : `${who(cause.by)} 的`}停止仍然有效，须取得控制权后解除`;
        case "runs_although_stopped":
          return "停止有效，但机器人仍在运行：停止只拦截经网关的命令，拦不住设备上的按钮";
      }
    },
    acknowledged: (by) => `${who(by)} 已确认`,
  },
  robots: {
    title: "所有机器人",
    found: (n, twins) => (twins === 0 ? `${n}` : `${n - twins}，另有 ${twins} 台孪生机器人`),
    search: "搜索机器人",
    none: "还没有机器人。管理员可在“连接”页面添加，或写入网关的配置文件。",
    noMatch: (search) => `没有与“${search}”匹配的机器人。`,
    loading: "正在等待机器人数据…",
    noLinkThen: (seconds) => `当时无连接，${duration(seconds)}前`,
    noLink: (seconds) => (seconds === null ? "无连接" : `无连接 ${duration(seconds)}`),
    alarm: (code) => `报警 ${code}`,
    parts: (n) => `计数 ${n}`,
    stands: (seconds) => `静止至少 ${duration(seconds)}`,
    old: (seconds) => `${duration(seconds)}前`,
    held: (holder) => `${who(holder)} 正在控制`,
    stopHolds: "停止有效",
    moves: "正在运动",
  },
  doing: (doing) => {
    switch (doing.kind) {
      case "no_link":
        return "网关与该机器人没有连接，其动作未知。";
      case "other_robot":
        return `该地址上应答的是另一台机器人${doing.found === null ? "" : `：${doing.found}`}。工程师确认之前，命令会被拒绝。`;
      case "not_read":
        return "尚未读取其状态。";
      case "alarm":
        return `报警 ${doing.code}${doing.text === null ? "" : `：${codeText(doing.code, doing.text)}`}。等待人员处理。`;
      case "stop_holds":
        return `${doing.stands ? "停止有效，机械臂静止。" : "停止有效；机械臂是否静止未知。"}${
          doing.mine ? "等待您解除停止。" : "等待控制者解除停止。"
        }`;
      case "manual":
        return "手动模式：由示教器旁的人员操作，此处的命令会被拒绝。";
      case "moves":
        return `机械臂正在运动${doing.program === null ? "" : `，程序${named(doing.program)}`}${listOf(doing.left)}。`;
      case "runs":
        if (!doing.stands) return `程序${named(doing.program)}正在运行${listOf(doing.left)}。机械臂当前是否运动未知。`;
        return doing.left !== null && doing.left > 0
          ? `程序${named(doing.program)}正在运行${listOf(doing.left)}。机械臂当前静止。`
          : `程序${named(doing.program)}正在运行。机械臂静止，等待信号或指令。`;
      case "waits_for_start":
        return doing.stands ? "自动模式待机，等待启动。" : "自动模式，没有程序运行。机械臂是否静止未知。";
      case "stopped":
        return doing.stands ? "已停止，等待人员在示教器上将钥匙转到自动，然后可在此启动。" : "其模式为“已停止”。机械臂是否静止未知。";
      case "unknown_mode":
        return `处于本页不认识的模式 ${doing.mode}。`;
    }
  },
  unmet: (reason) => UNMET[reason],
  lease: {
    take: "获取控制权",
    taking: "正在获取控制权…",
    give: "交还",
    mine: (left) => `由您控制，${left}`,
    others: (holder) => `${who(holder)} 正在控制`,
    free: "无人控制",
    unknown: "控制者未知",
    ended: "您的控制权已结束。",
  },
  control: {
    title: "控制",
    pause: "暂停",
    clearAlarm: "清除报警",
    clearStop: "解除停止",
    prepare: "准备启动…",
    run: (robot) => `按住以运行 ${robot}`,
    runHint: "按住按钮 1 秒。",
    runKeys: "或在按钮上按两次 Enter。",
    cancel: "取消",
    close: "关闭",
    prepareTitle: (robot) => `启动 ${robot}？`,
    prepareWhat: (program) => (program === null ? "控制器将运行其程序。" : `控制器将运行程序 ${program}。`),
    prepareLeft: (left) =>
      left === null
        ? "列表中是否还有指令未知。如果有，也会运行。"
        : left === 0
          ? "列表中没有剩余指令。"
          : `列表中还有 ${left} 条指令，也会运行。`,
    prepareSpeed: "控制器不报告全局速度，请按全速对待。",
    preparePerson: "请看机械臂：附近不得有人。",
    changed: (what) =>
      `未启动：${{
        robot: "应答的可能是另一台机器人，或其类型正在重新确认",
        program: "程序已变更，或不再可知",
        left: "列表中的剩余指令已变化，或不再可知",
        speed: "全局速度已变化，或不再可知",
      }[what]}。请重新准备。`,
    becameUnready: "现在不能启动：",
    sending: (what) => `${what}：正在发送…`,
    startAlarm: (code) => `启动：已接受。半分钟内出现报警 ${code}：见上方。`,
    accepted: (what) => `${what}：已接受。是否运动请看数值。`,
    alarmTaken: (what) => `${what}：控制器已接受。原因仍在的报警会保留或再次出现：请看报警。`,
    done: (what) => `${what}：完成。`,
    refused: (what, message) => `${what}：被拒绝。${message}`,
    notReady: (what, isSilent) =>
      `${what}：什么都没有发送。${isSilent ? "网关正在等待机器人的应答。" : "网关可能正在等待机器人的应答。"}请稍候再试。`,
    unknown: (what) => `${what}：结果未知。机器人可能已动作，请查看，如有疑问请停止。不会重新发送。`,
    start: "启动",
    lease: "控制权",
    alarmRefused: (what, _said, hasPanel) =>
      `${what}：被控制器拒绝。请排除原因、松开急停后重试，或${hasPanel ? "在此虚拟机器人的面板上" : "在示教器上"}清除报警。`,
    startRefused: (what) =>
      `${what}：被控制器拒绝。控制器只在自动模式、无报警且急停已松开时启动：请查看示教器。`,
  },
  stop: {
    one: (robot) => `停止 ${robot}`,
    many: "停止…",
    open: "选择要停止的机器人",
    all: (n) => `按住以停止全部 ${n} 台`,
    others: "未看到运动的机器人也可以停止。",
    every: (n) => `按住以停止车间所有机器人（${n} 台）`,
    none: "没有机器人在运动。",
    unknown: "哪些机器人在运动未知。",
    moving: "正在运行或可能运动的机器人",
    dismiss: "已阅",
    dismissOf: (robot) => `已阅 ${robot}`,
    not: "不是急停",
    key: "F9",
    of: (robot, text) => `${robot}：${text}`,
    waiting: "等待发送",
    sending: "正在发送",
    stopped: (at) => `已停止，${at} 确认`,
    notConfirmed: "未确认。请使用机器人旁的急停按钮。",
    notSent: "未发送。请使用机器人旁的急停按钮。",
    why: (why) =>
      ({
        no_answer: "尚无应答。",
        no_gateway: "无法连接网关。",
        in_turn: "正在等待其他机器人的停止命令。",
        given_up: "已让位于另一台机器人的停止命令。",
        cleared: "此后停止已被解除。",
        not_allowed: "您没有停止它的权限。",
        no_session: "您已退出登录。",
        no_token: "您已退出登录。",
        not_stopped: "无法证明机械臂已静止。",
      })[why] ?? refusalOf(why)[0],
  },
  robot: {
    missing: (name) => `没有名为“${name}”的机器人，或您无权查看。`,
    lastKnown: "最后所知：",
    alsoStop: "停止有效。",
    upTo: (seconds) => `最多 ${duration(seconds)}前`,
    axes: "各轴",
    axis: "轴",
    pose: "位姿",
    position: "位置",
    values: "其他数值",
    value: "数值",
    age: "时效",
    now: "当前",
    io: "输入和输出",
    on: "通",
    off: "断",
    notRead: "还没有读到任何数据。",
    ioPaused: "无人使用本页时不读取。",
    ioFailed: (message) => `无法读取：${message}`,
    alarms: "报警",
    alarmsUnknown: "当前报警未知。",
    noAlarms: "最近一天没有报警。",
    unseen: "最后所见",
    facts: "关于这台机器人",
    address: "地址",
    firmware: "固件",
    machine: "机器名称",
    model: "型号",
    modelUnknown: "未配置",
    every: "读取周期",
    unknown: "未知",
    yes: "是",
    no: "否",
    signals: {
      curMode: "模式",
      curAlarm: "报警",
      isMoving: "运动",
      origin: "已回原点",
      RemoteCmdLen: "剩余指令",
      curMold: "程序",
      curCycle: "本次循环",
      lastCycle: "上次循环",
    },
  },
  error: {
    page: "本页的这一部分出错。",
    again: "重新加载页面",
  },
  notThere: "没有这个页面。",
};
