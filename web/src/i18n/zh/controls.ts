/** The page of a robot: what a person does there. */
import type { CommandEnd, Deed } from "../../robots/around.ts";
import type { controls as english } from "../en/controls.ts";
import { RUN_ENDS } from "./run.ts";
import { duration, who } from "./say.ts";

const OUTCOMES: Record<CommandEnd, string> = {
  accepted: "控制器已接受",
  refused: "被拒绝",
  not_sent: "未发送",
  unknown: "结果未知",
};

const LEASE_ENDS: Record<Extract<Deed, { event: "lease_ended" }>["cause"], string> = {
  released: "已交还",
  expired: "未续期",
  taken: "被管理员接管",
  identity_changed: "应答的是另一台机器人",
  reconfigured: "机器人配置已更改",
  removed: "机器人已移除",
  gateway_ended: "网关已退出",
  owner_changed: "机器人已由其他网关接管，或数据库无响应",
};

function deed(of: Deed, outcome: CommandEnd | null): string {
  switch (of.event) {
    case "lease_began":
      return `${who(of.holder)} 获取控制权`;
    case "lease_ended":
      return `${who(of.holder)} 的控制权结束：${LEASE_ENDS[of.cause]}`;
    case "stop_began":
      return `${who(of.by)} 发出停止`;
    case "stop_ended":
      return of.confirmed ? "停止：已按要求完成" : "停止：未确认";
    case "stop_cleared":
      return "停止已解除";
    case "command_began":
      return `命令 ${of.command}${outcome === null ? "" : `：${OUTCOMES[outcome]}`}`;
    case "run_began":
      return `开始运行${of.program === null ? "程序" : ` ${of.program}`}：${of.steps} 步`;
    case "run_ended":
      return `运行结束（${RUN_ENDS[of.because]}）：已看到完成 ${of.done} 步`;
    case "global_speed":
      return of.set === null ? "所设的全局速度已不再可知" : `全局速度 ${of.set.percent} %，由 ${who(of.set.by)} 设定`;
    case "alarm_acknowledged":
      return `${who(of.by)} 确认报警 ${of.code}`;
    case "alarm_shelved":
      return `${who(of.by)} 搁置报警 ${of.code}`;
    case "alarm_unshelved":
      return `报警 ${of.code} 取消搁置`;
    case "identity_changed":
      return "应答的是另一台机器人";
    case "identity_accepted":
      return "已确认应答的机器人";
    case "robot_changed":
      return "机器人的地址或读取内容已更改";
  }
}

export const controls: typeof english = {
  around: {
    title: (code) => `报警 ${code} 前后一分钟`,
    show: "前后经过",
    showOf: (code, at) => `前后经过：报警 ${code}，${at}`,
    offset: (seconds) =>
      Math.abs(seconds) < 0.05
        ? "报警时"
        : `${seconds < 0 ? "之前" : "之后"} ${Math.abs(seconds) < 10 ? `${Math.abs(seconds).toFixed(1)} 秒` : duration(Math.abs(seconds))}`,
    what: "模式、程序、报警和连接为读取所得；控制权、命令、停止和运行为经此网关进行的操作。输入和输出不保存。",
    deedsSince: (at) => `${at} 之前的操作已不在网关保留的最近事件中。`,
    log: "这段时间的操作记录",
    deed,
  },
  parts: "本页各部分",
  tabs: { live: "实时", axes: "各轴", io: "输入输出", charts: "曲线", more: "更多" },
  taken: (what) => `${what}：控制器已接受。`,
  limits: "软限位",
  limitsOf: (low, high) => `${low} 至 ${high}`,
  nearness: { near: "接近限位", beyond: "超出限位" },
  stoppedBy: (by, at) => `由 ${who(by)} 于 ${at} 停止`,
  stopNotProved: "当时未能证明机械臂静止。",
  cleared: "停止已解除。",
  twin: "孪生",
  twinOf: "所孪生的机器人",
  speed: "全局速度",
  speedSet: (percent, by, at) => `${percent} %，由 ${who(by)} 于 ${at} 设定；控制器不报告此值`,
  speedOfPanel: (percent) => `${percent} %（来自此虚拟机器人的面板）`,
  speedOfPanelSet: (percent, by, at) => `${percent} %，由 ${who(by)} 于 ${at} 设定；此虚拟机器人的面板显示相同的值`,
  speedUnknown: "未知：控制器不报告此值，也不知道是否仍为上次设定的值。",
  percent: "全速的百分比",
  setSpeed: (robot) => `设定 ${robot} 的速度`,
  badPercent: "大于 0，最大 100，步距 0.1。",
  raiseTitle: (robot, percent) => `将 ${robot} 设为 ${percent} %？`,
  raise: (from, to) =>
    from === null ? `当前速度未知，${to} % 可能更快。` : `原为 ${from} %。之后的运动会更快，正在进行的运动也一样。`,
  speedNotSet: (why) => `速度未设定：${why === "" ? "速度或机器人已改变" : why}。请重新输入。`,
  raiseDo: (robot, percent) => `将 ${robot} 设为 ${percent} %`,
  motors: "电机",
  motorSpeed: "转速，转/分",
  torque: "扭矩，额定值的 %",
  noMotors: "该控制器不提供电机的转速和扭矩。",
  outputs: "设置输出",
  output: "输出或 M 点",
  outputNumber: "输出",
  outputHint: "接在输出上的设备可能会动作。",
  setOn: (point) => `${point} 通`,
  setOff: (point) => `${point} 断`,
  further: (on) => `其余各点（按编号）：${on === 0 ? "无接通" : `${on} 个接通`}`,
  mPoints: (from, to) => `M 点 ${from} 至 ${to}`,
  inputsOf: (from, to) => `输入 ${from} 至 ${to}`,
  outputsOf: (from, to) => `输出 ${from} 至 ${to}`,
  numbers: "计数器和寄存器",
  counter: "计数器",
  register: "寄存器（800 至 900）",
  read: "读取",
  readAt: (at) => `读取于 ${at}`,
  counterIs: (current, target, name) => `${current}，目标 ${target}${name === "" ? "" : `，${name}`}`,
  noValue: "控制器没有此值。",
  newCount: "新计数",
  newValue: "新数值",
  setCounter: (id) => `设定计数器 ${id}`,
  setRegister: (id) => `写入寄存器 ${id}`,
  wholeNumber: "请输入整数。",
  registerHint: "单元的程序可能会因寄存器而开始运动。",
  take: "接管…",
  takeTitle: (robot, holder) => `从 ${who(holder)} 接管 ${robot}？`,
  takeChanged: (before, now) => `${before} 已不再控制它：${now === null ? "现在空闲" : `现在由 ${now} 控制`}。请取消后重新询问。`,
  takeWhat: "网关会先停止机器人，且停止保持有效。网关正在运行的程序会结束。",
  takeReason: "原因（写入审计日志）",
  takeDo: (robot) => `停止 ${robot} 并接管`,
  needsEngineer: "需要工程师权限",
  run: "运行程序",
  runNone: "网关尚未保存程序。工程师可在“示教”页保存，或使用 PUT /v1/programs/NAME。",
  lookAgain: "重新查看",
  teach: "示教",
  program: "程序",
  choose: "请选择…",
  cannotRun: { mistakes: "有错误", no_step: "尚无步骤", taught: "只能在控制器上运行" },
  repeat: "次数",
  badRepeat: "1 至 1000。",
  planEnds: "规划未能到达末尾：",
  problems: {
    limit: "软限位",
    out_of_reach: "超出可达范围",
    singular: "奇异位置",
    alarm: "报警",
    waiting: "等待规划中无法置位的信号",
    no_end: "没有结束",
    passed_over: "控制器不执行该步",
  },
  step: (step) => (step === null ? "" : `第 ${step} 步：`),
  panel: "虚拟机器人的面板",
  panelWhat: "模拟机器旁人员的操作：真实机器人没有此面板。",
  panelOld: (seconds) => `${duration(seconds)}前`,
  panelPaused: "无人使用本页时不读取。",
  panelFailed: (message) => `无法读取面板：${message}`,
  panelIs: (mode, percent) => `${mode}，全局速度 ${percent} %`,
  panelProgram: "程序",
  emergency: "按下急停",
  emergencyIs: "急停已按下。",
  release: "松开急停",
  clearAlarm: "清除报警",
  key: "模式钥匙",
  keys: { manual: "手动", auto: "自动", stop: "停止" },
  buttons: { start: "启动", stop: "停止", pause: "暂停", single_cycle: "单循环", single_step: "单步" },
  hold: (what) => `按住：${what}`,
  panelStop: "停止按钮",
  panelPause: "暂停按钮",
  input: "输入",
  inputsOn: (names) => `接通：${names}`,
  inputsNone: "没有接通的输入。",
  faults: "报警号",
  raise_alarm: "触发",
  badAlarm: "1 至 10000。",
  jog: "手动移动",
  jogNeeds: "请先将模式钥匙转到手动",
  jogHold: "按住按钮：该轴移动，松开即停。本页被隐藏或与网关断开时也会停止。",
  jogSteps: "或按步距移动：",
  jogStep: "步距",
  jogBy: (axis, by) => `${axis} ${by}`,
  jogSpeed: "速度，百分比",
  home: "所有轴移到 0",
  switch: "选用",
  panelDid: (what) => `${what}：面板已接受。`,
};
