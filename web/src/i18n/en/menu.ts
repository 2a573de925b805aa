/** The names of the pages. */
export const menu = {
  title: "Pages",
  alarms: "Alarms",
  production: "Production",
  history: "History",
  audit: "Audit log",
  connections: "Connections",
  users: "Users",
  tokens: "Tokens",
  settings: "Settings",
  gallery: "Components",
  teach: "Teach",
  loading: "Loading…",
};
