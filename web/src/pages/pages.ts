/**
 * The pages. A page is a folder or a file here, a route in route.ts, and a branch in App.svelte. Those that are
 * not needed at first are a chunk each, which the browser loads when somebody opens the page.
 */
import type { Component } from "svelte";
import type { Route } from "../route.ts";

export { default as HallPage } from "./hall/HallPage.svelte";
export { default as OtherSession } from "./OtherSession.svelte";
export { default as RobotPage } from "./robot/RobotPage.svelte";
export { default as SetupPage } from "./SetupPage.svelte";
export { default as SignInPage } from "./SignInPage.svelte";

type Later = Exclude<Route["page"], "hall" | "robot" | "unknown">;

/** The pages in chunks of their own. They get what their route has in it. */
export const later: { [Page in Later]: () => Promise<{ default: Component<any> }> } = {
  alarms: () => import("./alarms/AlarmsPage.svelte"),
  production: () => import("./production/ProductionPage.svelte"),
  history: () => import("./history/HistoryPage.svelte"),
  audit: () => import("./audit/AuditPage.svelte"),
  connections: () => import("./connections/ConnectionsPage.svelte"),
  users: () => import("./users/UsersPage.svelte"),
  tokens: () => import("./tokens/TokensPage.svelte"),
  settings: () => import("./settings/SettingsPage.svelte"),
  gallery: () => import("./gallery/GalleryPage.svelte"),
  teach: () => import("./teach/TeachPage.svelte"),
};
