/**
 * The alarms in Chinese, by their codes: our translation of the table in crates/r6-proto/src/alarm.rs, which has the
 * pendant's own alarms in English. tests/alarms.test.ts compares the codes of the two. A code that is not here is told
 * as the gateway tells it.
 */
const SERVICE = "请联系设备服务人员，并告知此编号";
const RESTART = "关闭电柜电源后重新接通；如再次出现，请联系设备服务人员";
const WIRING = "检查该部件的电缆和电源，然后清除报警";
const POINTS = "如果点由相机发送，请检查相机和工件；否则在示教器上修改程序；然后清除报警";
const PROGRAM = "在示教器上修改程序，然后清除报警";
const SETTINGS = "在示教器上检查机器设置，然后清除报警";
const SOFT_LIMIT = "目标点或路径超出软限位：修改程序；如果轴停在限位外，请手动移回；然后清除报警";
const SLOWER = "降低速度或加速度，检查机械负载，然后清除报警";
const DRIVE = "查看驱动器自身的显示，冷却或排除故障，然后清除报警";
const SWITCH = "手动将该轴移出限位开关，然后清除报警";

/** How many codes a row covers: one, one for each of the eight axes, or all up to this one. */
type Span = "one" | "axes" | number;

const ROWS: readonly [first: number, span: Span, text: string, remedy: string][] = [
  [1, "one", "未初始化", RESTART],
  [2, "one", "主板与示教器的轴配置不一致", SETTINGS],
  [3, "one", "轴配置错误", SETTINGS],
  [4, "one", "内存不足", "删除不用的程序，然后重新启动"],
  [5, "one", "无法读取示教数据", PROGRAM],
  [6, "one", "无法编辑示教数据", PROGRAM],
  [7, "one", "急停", "确保工作区安全，松开急停，然后清除报警"],
  [8, "one", "自动跳转错误", PROGRAM],
  [9, "one", "与主机的连接失败", "与电脑或示教器的连接丢失，或心跳报文超时：发送过心跳后，须每 10 秒发送一次；恢复连接，然后清除报警。r6 的程序在相机不应答或没有图像时也会触发此报警"],
  [10, "one", "程序错误", PROGRAM],
  [11, "one", "配置存储失败", RESTART],
  [12, "one", "机器设置错误", SETTINGS],
  [13, "one", "单步调试", "在示教器上退出单步调试"],
  [14, "one", "无法读取存储器", RESTART],
  [15, "one", "IO 板未连接", WIRING],
  [16, "one", "伺服：无法读取绝对位置", WIRING],
  [17, "one", "伺服：绝对位置校验错误", WIRING],
  [18, "one", "伺服：绝对位置功能错误", WIRING],
  [19, "one", "伺服：读取绝对位置超时", WIRING],
  [20, 22, "IO 板未连接（20：2 号板，21：3 号板，22：4 号板）", WIRING],
  [23, "one", "程序已变更", "重新载入程序"],
  [24, "one", "FPGA 故障", RESTART],
  [25, "one", "模拟量板校验错误", WIRING],
  [26, "one", "模拟量板超时", WIRING],
  [27, "one", "用户坐标系错误", SETTINGS],
  [28, "one", "间隔错误", SETTINGS],
  [29, "one", "位置不稳定", SLOWER],
  [30, "one", "坐标系为空", SETTINGS],
  [42, "one", "伺服未接通", "接通伺服（某些固件在 actionStop 之后：清除报警，然后在示教器上切到自动并启动）"],
  [90, "axes", "电机报警", DRIVE],
  [100, "axes", "轴未运行", DRIVE],
  [110, "axes", "速度设置错误", SLOWER],
  [120, "axes", "超速", SLOWER],
  [130, "axes", "正向软限位", SOFT_LIMIT],
  [140, "axes", "负向软限位", SOFT_LIMIT],
  [150, "axes", "位置偏差过大", SLOWER],
  [160, "axes", "加速度超限", SLOWER],
  [170, "axes", "正向限位开关", SWITCH],
  [180, "axes", "负向限位开关", SWITCH],
  [190, "axes", "未设原点", "在示教器上回原点"],
  [200, "one", "路径动作失败", "路径无法执行（够不着、奇异点，或运动中列表被替换）：修改目标点或等待静止，然后清除报警"],
  [201, 218, "未设置路径的点", POINTS],
  [219, "one", "设置路径速度失败", "速度须大于 0；路径速度（动作 51）须为整数 mm/s"],
  [220, "one", "路径规划失败（加速度）", SLOWER],
  [221, "one", "路径无法重新规划", SLOWER],
  [222, "one", "堆叠等待中", PROGRAM],
  [223, "one", "堆叠没有数据源", PROGRAM],
  [300, "one", "计数器未定义", "在示教器上定义计数器"],
  [500, "axes", "过流", DRIVE],
  [510, "axes", "编码器 Z 脉冲错误", WIRING],
  [520, "axes", "没有编码器 Z 脉冲", WIRING],
  [530, "axes", "原点偏移", "检查零点标记，并在示教器上回原点"],
  [600, 605, "不安全区 1 至 6（600：1 区）", "手动将机械臂移出该区，修改目标点，然后清除报警"],
  [700, "axes", "伺服：初始化", RESTART],
  [710, "axes", "伺服：EEPROM", SERVICE],
  [720, "axes", "伺服：模拟量输入", SERVICE],
  [730, "axes", "伺服：执行", RESTART],
  [740, "axes", "伺服：过热 1", DRIVE],
  [750, "axes", "伺服：过压", DRIVE],
  [760, "axes", "伺服：欠压", DRIVE],
  [770, "axes", "伺服：主电源断开", WIRING],
  [780, "axes", "伺服：门极关断", DRIVE],
  [790, "axes", "伺服：过热 2", DRIVE],
  [800, "axes", "伺服：过载", "降低速度，分成较大的步，步间等待静止，检查机械负载，然后清除报警"],
  [810, "axes", "伺服：超速", SLOWER],
  [820, "axes", "伺服：频率过高", SLOWER],
  [830, "axes", "伺服：位置误差", SLOWER],
  [840, "axes", "伺服：编码器", WIRING],
  [850, "axes", "伺服：过流", DRIVE],
  [900, "one", "编码器电池", "在电柜接通时更换电池，然后回原点"],
  [910, "one", "编码器", WIRING],
  [1000, "one", "禁止使能", "解除禁止使能的条件（钥匙、防护门、使能开关）"],
  [1500, 1691, "伺服总线", WIRING],
  [1692, "one", "厂商不匹配", SETTINGS],
  [1693, "one", "控制类型不匹配", SETTINGS],
  [5000, 10_000, "程序的用户报警", "查看程序中触发它的位置，然后清除报警"],
];

/** The first and the last code of each row. */
export const SPANS: readonly [number, number][] = ROWS.map(([first, span]) => [first, last(first, span)]);

function last(first: number, span: Span): number {
  return span === "one" ? first : span === "axes" ? first + 7 : span;
}

function rowOf(code: number): (typeof ROWS)[number] | undefined {
  return ROWS.find(([first, span]) => code >= first && code <= last(first, span));
}

/** What the code means. `said`: what the gateway says. */
export function codeText(code: number, said: string): string {
  const waited = /^waiting for (.+) took too long$/.exec(said)?.[1];
  if (waited !== undefined) return `等待 ${waited} 超时`;
  const row = rowOf(code);
  if (row === undefined) return said;
  const [first, span, text] = row;
  return span === "axes" ? `J${code - first + 1}：${text}` : text;
}

/** What to do about it. `said`: what the gateway says. */
export function codeRemedy(code: number, said: string): string {
  if (said === "look why the signal did not come, then clear the alarm") return "检查信号为何没有到来，然后清除报警";
  return rowOf(code)?.[3] ?? said;
}
