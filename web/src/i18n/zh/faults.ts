/** Words of the faults that a virtual robot can be given. */
import type { faults as en } from "../en/faults.ts";
import { duration } from "./say.ts";

const NAMES: Record<string, string> = {
  refuse: "拒绝连接",
  "black-hole": "连接请求无应答",
  silence: "新连接得不到任何应答",
  "reset-mid-frame": "连接在帧中途被复位",
  "close-before-reply": "应答前关闭连接",
  "half-open": "连接失去响应",
  pieces: "帧分片到达",
  coalesce: "多个帧一起到达",
  latency: "链路延迟",
  slow: "链路缓慢",
  noise: "链路上字节被改变",
  stall: "帧的后半部分迟到",
  "bad-json": "应答是损坏的 JSON",
  "bad-field": "应答的字段有误",
  "bad-pack-id": "应答的 packID 有误",
  "late-reply": "应答迟到",
  "crossed-reply": "应答发给所有客户端",
  "bad-list": "数值与地址不符",
  echo: "请求被原样返回",
  unsolicited: "收到未请求的帧",
  "not-executed": "命令被接受但不执行",
  "not-acknowledged": "命令被执行但不应答",
  "list-full": "指令列表已满",
  "list-frozen": "指令列表不开始执行",
  "rejected-mid-batch": "列表执行一半后被拒绝",
  "task-dead": "只应答心跳",
  "frozen-values": "数值不再变化",
  "stop-ignored": "停止被忽略",
  dwell: "手臂在每个点停留",
  "late-list": "列表迟后才被接收",
};

export const faults: typeof en = {
  title: "故障",
  what: "控制器及其链路可能出现的问题，用于观察程序如何应对。",
  none: "没有生效的故障。",
  named: (word) => NAMES[word] ?? word,
  inForce: (name, kind, percent, left) =>
    `${name}${kind === null ? "" : `（${kind}）`}${percent < 100 ? `，${percent} %` : ""}${
      left === null ? "" : `，${duration(left)}后结束`
    }`,
  fault: "故障类型",
  kind: "种类",
  chance: "发生概率，百分比",
  seconds: "秒数；留空则持续到手动结束",
  begin: "开始",
  begins: (name) => `开始：${name}`,
  end: "结束",
  ends: (name) => `结束：${name}`,
  endAll: "结束所有故障",
  cutPower: "断电",
  powerOff: "已断电。",
  wrong: "1 至 100 %，1 至 86400 秒。",
};
