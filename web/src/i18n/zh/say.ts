/** Spans of time, and who did something, in Chinese. */
import { tokenOf } from "../actor.ts";

/** A time span for people: `12 秒`. */
export function duration(seconds: number): string {
  const whole = Math.max(0, Math.floor(seconds));
  if (whole < 60) return `${whole} 秒`;
  if (whole < 3600) return `${Math.floor(whole / 60)} 分 ${whole % 60} 秒`;
  return `${Math.floor(whole / 3600)} 小时 ${Math.floor((whole % 3600) / 60)} 分`;
}

/** Seconds with a decimal: a program of 5.28 s is not one of 5 s. */
export function seconds(ms: number): string {
  return ms < 60_000 ? `${(ms / 1000).toFixed(2)} 秒` : duration(ms / 1000);
}

/** Who did something. */
export function who(by: string): string {
  const token = tokenOf(by);
  return token === null ? by : `令牌 ${token.number}${token.name}`;
}
