/**
 * Requests to the gateway. Each ends after a time. Three questions at most are under way, and one while stops
 * are: a browser has six connections to a server, and a stop must not wait for one. What a person does is sent
 * at once: an order that waits would be carried out later than it was given.
 */
import { stops } from "../stop/stops.ts";
import type { Code, Problem } from "./types.ts";

/** How long a request may take, in milliseconds. */
const PATIENCE = 10_000;
/**
 * For how long an order may be on its way, in milliseconds: what it was given for may be over then. The page knows the
 * clock of the gateway to a second.
 */
export const HOLDS = 3_000;
const MAX_UNDER_WAY = 3;
const MAX_BESIDE_STOPS = 1;

/**
 * How a request ended. `unknown`: no answer came, so the gateway may have carried it out or not. Nothing is
 * sent again by itself.
 */
export type Answer<T> =
  | { kind: "ok"; value: T }
  | Refusal
  | { kind: "unknown" };

type Refusal = { kind: "refused"; status: number; problem: Problem };

export type Method = "GET" | "POST" | "PUT" | "DELETE";

export interface Options {
  body?: unknown;
  csrf?: string | null;
  /** More headers, such as `If-Match`. */
  headers?: Record<string, string>;
  /** Asks in the name of this token, and not of the session. */
  bearer?: string;
  patience?: number;
  /** The answer is text, and no JSON. */
  isText?: boolean;
  /** What makes a second request with it harmless: see the runs of programs. */
  idempotencyKey?: string;
  /** Lets the request go on when the page is closed. */
  keepalive?: boolean;
  /** Gives a question up whose answer nothing waits for any more. */
  signal?: AbortSignal;
}

/** Sessions are counted, so that a late answer to a question of an earlier one does not end this one. */
let era = 0;
let signedOut: () => void = () => {};

/** A session begins. Calls this once if the gateway answers to a question of it that it does not know it. */
export function whenSignedOut(act: () => void): void {
  era += 1;
  signedOut = act;
}

/** A sign-in with a wrong name, and a wrong password, say nothing about the session. */
function isSignedOut(path: string, options: Options, { code }: Problem): boolean {
  const isSignIn = options.bearer !== undefined || path === "/v1/session/token";
  return !isSignIn && code !== "wrong_password";
}

/** The clock of the gateway, in milliseconds since 1970; `null` while it is not known. */
let clock: () => number | null = () => null;

/** Orders say from now on until when they hold, on this clock of the gateway. */
export function goByClock(time: () => number | null): void {
  clock = time;
}

let underWay = 0;
const waiting: (() => void)[] = [];

async function turn(isFirst = false): Promise<void> {
  const ready = new Promise<void>((next) => void (isFirst ? waiting.unshift(next) : waiting.push(next)));
  go();
  await ready;
}

function go(): void {
  while (waiting.length > 0 && underWay < (stops.isBusy ? MAX_BESIDE_STOPS : MAX_UNDER_WAY)) {
    underWay += 1;
    waiting.shift()?.();
  }
}

stops.onChange(go);

/** Sends a request. Never throws. */
export async function call<T>(method: Method, path: string, options: Options = {}): Promise<Answer<T>> {
  if (method !== "GET") return send(method, path, options);
  return inTurn(options, () => send(method, path, options));
}

/** A file of the gateway, in the form of this media type. */
export interface File {
  bytes: Blob;
  /** Where to read on; `null` at the end. */
  next: string | null;
}

/** Asks for an answer as a file. Never throws. */
export async function file(path: string, type: string, options: Options = {}): Promise<Answer<File>> {
  return inTurn(options, async () => {
    const begun = era;
    const response = await ask("GET", path, options, type);
    if (response === null) return { kind: "unknown" };
    try {
      if (!response.ok) return refused(path, options, await response.text(), response.status, begun);
      return { kind: "ok", value: { bytes: await response.blob(), next: response.headers.get("r6-next-cursor") } };
    } catch {
      return { kind: "unknown" };
    }
  });
}

/** A question and its answer, on the page's clock in milliseconds. */
export interface Echo {
  sent: number;
  /** When the answer came, or the page gave up. */
  came: number;
  isAnswered: boolean;
  /** The gateway's clock in the answer, since 1970; `null` if it did not say. */
  date: number | null;
}

/** Asks whether the gateway answers, before other questions that wait. Never throws. */
export async function echo(patience: number): Promise<Echo> {
  await turn(true);
  const sent = performance.now();
  const response = await ask("GET", "/healthz", { patience });
  const came = performance.now();
  underWay -= 1;
  go();
  const date = response?.ok === true ? Date.parse(response.headers.get("Date") ?? "") : NaN;
  return { sent, came, isAnswered: response !== null, date: Number.isNaN(date) ? null : date };
}

async function inTurn<T>(options: Options, question: () => Promise<Answer<T>>): Promise<Answer<T>> {
  await turn();
  try {
    return options.signal?.aborted === true ? { kind: "unknown" } : await question();
  } finally {
    underWay -= 1;
    go();
  }
}

async function send<T>(method: Method, path: string, options: Options): Promise<Answer<T>> {
  const begun = era;
  const response = await ask(method, path, options);
  if (response === null) return { kind: "unknown" };
  let text: string;
  try {
    text = await response.text();
  } catch {
    return { kind: "unknown" };
  }
  if (!response.ok) return refused(path, options, text, response.status, begun);
  try {
    return { kind: "ok", value: (options.isText ? text : text === "" ? undefined : JSON.parse(text)) as T };
  } catch {
    // It was cut off, or somebody between page and gateway answered.
    return { kind: "unknown" };
  }
}

/** The beginning of an answer; `null` if none came. */
async function ask(method: Method, path: string, options: Options, type?: string): Promise<Response | null> {
  const headers: Record<string, string> = { ...options.headers };
  if (options.body !== undefined) headers["Content-Type"] = "application/json";
  if (type !== undefined) headers["Accept"] = type;
  if (method !== "GET" && options.csrf) headers["X-CSRF-Token"] = options.csrf;
  if (options.bearer !== undefined) headers["Authorization"] = `Bearer ${options.bearer}`;
  if (method !== "GET") {
    // A browser sends an order again by itself if its connection breaks before the answer.
    headers["Idempotency-Key"] = options.idempotencyKey ?? freshKey();
    const now = clock();
    if (now !== null) headers["Valid-Until"] = new Date(now + HOLDS).toISOString();
  }
  const patience = AbortSignal.timeout(options.patience ?? PATIENCE);
  const init: RequestInit = {
    method,
    headers,
    cache: "no-store",
    credentials: options.bearer === undefined ? "same-origin" : "omit",
    keepalive: options.keepalive ?? false,
    signal: options.signal === undefined ? patience : AbortSignal.any([options.signal, patience]),
  };
  if (options.body !== undefined) init.body = JSON.stringify(options.body);
  try {
    return await fetch(path, init);
  } catch {
    return null;
  }
}

/** A refusal. `begun`: the session in which the question was asked. */
function refused(path: string, options: Options, text: string, status: number, begun: number): Refusal {
  const problem = problemOf(text, status);
  if (status === 401 && begun === era && isSignedOut(path, options, problem)) signedOut();
  return { kind: "refused", status, problem };
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

/** A key that no other request has: 128 random bits. Pages without TLS have no `randomUUID`. */
export function freshKey(): string {
  return Array.from(crypto.getRandomValues(new Uint8Array(16)), (byte) => byte.toString(16).padStart(2, "0")).join("");
}
