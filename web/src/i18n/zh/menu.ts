/** The names of the pages. */
import type { menu as english } from "../en/menu.ts";

export const menu: typeof english = {
  title: "页面",
  alarms: "报警",
  production: "生产",
  history: "历史",
  audit: "审计日志",
  connections: "连接",
  users: "用户",
  tokens: "令牌",
  settings: "设置",
  gallery: "组件",
  teach: "示教",
  loading: "正在加载…",
};
