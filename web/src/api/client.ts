/**
 * Requests to the gateway. Each ends after a time, and four at most are under way: a browser has six
 * connections to a server, and a stop must never wait for one.
 */
import type { Code, Problem } from "./types.ts";

/** How long a request may take, in milliseconds. */
const PATIENCE = 10_000;
const MAX_UNDER_WAY = 4;

/**
 * How a request ended. `unknown`: no answer came, so the gateway may have carried it out or not. Nothing is
 * sent again by itself.
 */
export type Answer<T> =
  | { kind: "ok"; value: T }
  | { kind: "refused"; status: number; problem: Problem }
  | { kind: "unknown" };

export type Method = "GET" | "POST" | "PUT" | "DELETE";

export interface Options {
  body?: unknown;
  csrf?: string | null;
  patience?: number;
  /** Lets the request go on when the page is closed. */
  keepalive?: boolean;
}

let underWay = 0;
const waiting: (() => void)[] = [];

async function turn(): Promise<void> {
  if (underWay < MAX_UNDER_WAY) {
    underWay += 1;
    return;
  }
  await new Promise<void>((next) => waiting.push(next));
}

function done(): void {
  const next = waiting.shift();
  if (next === undefined) underWay -= 1;
  else next();
}

/** Sends a request. Never throws. */
export async function call<T>(method: Method, path: string, options: Options = {}): Promise<Answer<T>> {
  if (options.keepalive === true) return send(method, path, options);
  await turn();
  try {
    return await send(method, path, options);
  } finally {
    done();
  }
}

async function send<T>(method: Method, path: string, options: Options): Promise<Answer<T>> {
  const headers: Record<string, string> = {};
  if (options.body !== undefined) headers["Content-Type"] = "application/json";
  if (method !== "GET" && options.csrf) headers["X-CSRF-Token"] = options.csrf;
  const init: RequestInit = {
    method,
    headers,
    cache: "no-store",
    keepalive: options.keepalive ?? false,
    signal: AbortSignal.timeout(options.patience ?? PATIENCE),
  };
  if (options.body !== undefined) init.body = JSON.stringify(options.body);
  let response: Response;
  let text: string;
  try {
    response = await fetch(path, init);
    text = await response.text();
  } catch {
    return { kind: "unknown" };
  }
  if (response.ok) return { kind: "ok", value: (text === "" ? undefined : JSON.parse(text)) as T };
  return { kind: "refused", status: response.status, problem: problemOf(text, response.status) };
}

/** What a body says is wrong. A proxy in between may answer with something else than a problem. */
export function problemOf(text: string, status: number): Problem {
  try {
    const read: unknown = JSON.parse(text);
    if (typeof read === "object" && read !== null && "code" in read && "message" in read) {
      return { code: read.code as Code, message: String(read.message) };
    }
  } catch {
    // It is no JSON.
  }
  return { code: "unknown", message: `HTTP ${status}` };
}
