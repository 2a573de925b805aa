/** The pages. A page is a folder or a file here, a route in route.ts, and a branch in App.svelte. */
export { default as HallPage } from "./hall/HallPage.svelte";
export { default as OtherSession } from "./OtherSession.svelte";
export { default as RobotPage } from "./robot/RobotPage.svelte";
export { default as SignInPage } from "./SignInPage.svelte";
