/** Words of the page of settings. */
import type { Weekday } from "../../api/types.ts";
import type { hallSettings as english } from "../en/settings.ts";

const DAYS: Record<Weekday, string> = {
  mon: "周一",
  tue: "周二",
  wed: "周三",
  thu: "周四",
  fri: "周五",
  sat: "周六",
  sun: "周日",
};

export const hallSettings: typeof english = {
  hall: "车间的时区与班次",
  byFile: "这些设置由网关或单元的配置文件管理。请在文件中修改。作为服务运行的网关收到 SIGHUP 后重新读取；`r6 up` 须重新启动。",
  needsAdmin: "由面向所有机器人的管理员更改。",
  zone: "时区",
  zoneHint: "IANA 数据库中的名称，例如 Asia/Shanghai 或 Europe/Berlin。看板的所有时间均按此时区显示。",
  zoneUnknown: "此浏览器不认识该时区，网关可能认识。",
  now: (at) => `当地现在是 ${at}。`,
  shifts: "班次",
  one: "班次",
  noShift: "没有班次。生产数据仅按天显示。",
  shift: "名称",
  shiftHint: "可用 a 至 z、数字和 -",
  days: "开始于",
  day: (day) => DAYS[day],
  begin: "开始",
  end: "结束",
  timeHint: "例如 06:00；24:00 表示一天结束",
  addShift: "添加班次",
  removeShift: (name) => `移除班次 ${name}`,
  remove: "移除",
  badName: "1 至 32 个字符：a 至 z、数字和 -。",
  sameName: "另一个班次已使用此名称。",
  badTime: "请填写时间，例如 06:00。",
  noDay: "请选择日期。",
  fix: "以上有内容不符合要求。",
  changes: "更改后，以前的数据也按新的班次统计。",
  did: "更改车间设置",
  reset: "撤销我的更改",
  browser: "此浏览器",
  browserWhat: "仅保存在此浏览器中。",
  gateway: "网关",
  address: "地址",
  version: "版本",
};
