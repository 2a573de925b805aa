import { beforeEach, expect, test, vi } from "vitest";

const TOKEN = `r6_${"0".repeat(64)}`;
const LINK = "A".repeat(43);
const ANNA = { user: "anna", token: null, token_name: null, role: "admin", robot: null, csrf: "anna's", ends_in_ms: 1, idle_ends_in_ms: 1 };
const TOKEN_7 = { user: null, token: 7, token_name: null, role: "operator", robot: null, csrf: null, ends_in_ms: null, idle_ends_in_ms: null };

interface Asked {
  method: string;
  path: string;
  bearer: string | undefined;
  body: unknown;
}

/** A page whose address has this text behind `#`, and a gateway that answers so. */
async function begin(hash: string, answer: (asked: Asked) => Response | null) {
  const asked: Asked[] = [];
  vi.stubGlobal("location", { hash, pathname: "/", search: "" });
  vi.stubGlobal("history", { replaceState: () => {} });
  vi.stubGlobal("fetch", (path: string, init: RequestInit) => {
    const bearer = (init.headers as Record<string, string>)["Authorization"];
    const body: unknown = typeof init.body === "string" ? JSON.parse(init.body) : null;
    const one = { method: init.method ?? "GET", path, bearer, body };
    asked.push(one);
    const response = answer(one);
    return response === null ? Promise.reject(new TypeError("Failed to fetch")) : Promise.resolve(response);
  });
  vi.resetModules();
  const { session } = await import("./session.svelte.ts");
  await session.begin();
  return { session, asked };
}

const refused = (status: number): Response => Response.json({ code: "no_session", message: "" }, { status });

beforeEach(() => vi.unstubAllGlobals());

test("a browser asks for its session only if it opened one before", async () => {
  const kept = new Map<string, string>();
  const storage = {
    getItem: (key: string) => kept.get(key) ?? null,
    setItem: (key: string, value: string) => void kept.set(key, value),
    removeItem: (key: string) => void kept.delete(key),
  };
  vi.stubGlobal("localStorage", storage);
  const first = await begin("", () => refused(401));
  expect([first.session.phase, first.asked]).toEqual(["out", []]);
  vi.stubGlobal("localStorage", storage);
  const second = await begin(`#${TOKEN}`, () => Response.json(TOKEN_7));
  expect(second.asked.map(({ method, path }) => `${method} ${path}`)).toEqual(["POST /v1/session/token"]);
  vi.stubGlobal("localStorage", storage);
  const third = await begin("", () => Response.json(TOKEN_7));
  expect([third.session.phase, third.asked.length]).toEqual(["in", 1]);
  third.session.ended();
  vi.stubGlobal("localStorage", storage);
  const fourth = await begin("", () => refused(401));
  expect([fourth.session.phase, fourth.asked]).toEqual(["out", []]);
});

test("signing out ends the session only if the gateway says so", async () => {
  let ends: Response | null = null;
  const { session } = await begin("", ({ method }) => (method === "GET" ? Response.json(ANNA) : ends));
  expect(session.phase).toBe("in");
  await session.signOut();
  expect([session.phase, session.isMaybeOpen]).toEqual(["in", true]);
  ends = refused(503);
  await session.signOut();
  expect([session.phase, session.isMaybeOpen]).toEqual(["in", true]);
  ends = new Response(null, { status: 204 });
  await session.signOut();
  expect([session.phase, session.isMaybeOpen]).toEqual(["out", false]);
});

test("a session has ended if the gateway does not know it", async () => {
  const { session } = await begin("", ({ method }) => (method === "GET" ? Response.json(ANNA) : refused(401)));
  await session.signOut();
  expect(session.phase).toBe("out");
});

test("a link signs in where no session is open", async () => {
  const { session, asked } = await begin(`#${TOKEN}`, ({ method }) => (method === "GET" ? refused(401) : Response.json(TOKEN_7)));
  expect([session.phase, session.session?.token]).toEqual(["in", 7]);
  expect(asked.map(({ method, path }) => `${method} ${path}`)).toEqual(["GET /v1/session", "POST /v1/session/token"]);
});

test("the link of `r6 up` signs in with a secret that is no token", async () => {
  const { session, asked } = await begin(`#${LINK}`, ({ method }) => (method === "GET" ? refused(401) : Response.json(TOKEN_7)));
  expect([session.phase, session.session?.token]).toEqual(["in", 7]);
  expect(asked.map(({ method, path }) => `${method} ${path}`)).toEqual(["GET /v1/session", "POST /v1/session/link"]);
  expect(asked[1]?.body).toEqual({ secret: "0".repeat(64) });
});

test("the link of `r6 up` is asked for whom it is before it replaces a session", async () => {
  const answer = ({ method, path }: Asked): Response => {
    if (method === "DELETE") return new Response(null, { status: 204 });
    return Response.json(path.endsWith("link") ? TOKEN_7 : ANNA);
  };
  const { session, asked } = await begin(`#${LINK}`, answer);
  expect(session.offer).toMatchObject({ known: { user: "anna" }, offered: { token: 7 } });
  expect(asked.at(-1)).toMatchObject({ path: "/v1/session/link", body: { look: true } });
  await session.replace();
  expect([session.phase, session.session?.token]).toEqual(["in", 7]);
  expect(asked.at(-1)?.body).toEqual({ secret: "0".repeat(64) });
});

test("a link replaces an open session only if the person says so", async () => {
  const answer = ({ method, path, bearer }: Asked): Response => {
    if (method === "GET") return Response.json(bearer === undefined ? ANNA : TOKEN_7);
    return method === "DELETE" ? new Response(null, { status: 204 }) : Response.json(path.endsWith("token") ? TOKEN_7 : ANNA);
  };
  const kept = await begin(`#${TOKEN}`, answer);
  expect(kept.session.phase).toBe("asking");
  expect(kept.session.offer).toMatchObject({ known: { user: "anna" }, offered: { token: 7, role: "operator" } });
  expect(kept.asked.every(({ method }) => method === "GET")).toBe(true);
  kept.session.keep();
  expect([kept.session.phase, kept.session.session?.user]).toEqual(["in", "anna"]);

  const replaced = await begin(`#${TOKEN}`, answer);
  await replaced.session.replace();
  expect([replaced.session.phase, replaced.session.session?.token]).toEqual(["in", 7]);
  expect(replaced.asked.map(({ method }) => method)).toEqual(["GET", "GET", "DELETE", "POST"]);
});

test("the link of the session that is open asks nothing, and an invalid one replaces nothing", async () => {
  const same = await begin(`#${TOKEN}`, () => Response.json(TOKEN_7));
  expect(same.session.phase).toBe("in");
  const bad = await begin(`#${TOKEN}`, ({ bearer }) => (bearer === undefined ? Response.json(ANNA) : refused(401)));
  expect([bad.session.phase, bad.session.offer?.offered]).toEqual(["asking", null]);
});

test("a session that may still be open is not replaced", async () => {
  const { session, asked } = await begin(`#${TOKEN}`, ({ method, bearer }) =>
    method === "GET" ? Response.json(bearer === undefined ? ANNA : TOKEN_7) : null,
  );
  await session.replace();
  expect([session.phase, session.isMaybeOpen]).toEqual(["asking", true]);
  expect(asked.some(({ method }) => method === "POST")).toBe(false);
});

test("an answer that the gateway does not know the session ends it at once; a wrong password does not", async () => {
  let code = "wrong_password";
  const { session } = await begin("", ({ path }) =>
    path === "/v1/session" ? Response.json(ANNA) : Response.json({ code, message: "" }, { status: 401 }),
  );
  const { call } = await import("../api/client.ts");
  await call("PUT", "/v1/session/password", { body: {} });
  expect(session.phase).toBe("in");
  // Another token was asked about, and not the session.
  code = "no_token";
  await call("GET", "/v1/users", { bearer: TOKEN });
  expect(session.phase).toBe("in");
  code = "no_session";
  await call("GET", "/v1/users");
  expect([session.phase, session.problem?.code]).toEqual(["out", "ended"]);
});

test("a late answer to a question of an earlier session does not end the present one", async () => {
  let answerLate: ((response: Response) => void) | null = null;
  const { session } = await begin("", ({ method }) => (method === "DELETE" ? new Response(null, { status: 204 }) : Response.json(ANNA)));
  const { call } = await import("../api/client.ts");
  const plain = globalThis.fetch;
  vi.stubGlobal("fetch", () => new Promise<Response>((answer) => (answerLate = answer)));
  const late = call("GET", "/v1/users");
  await vi.waitFor(() => expect(answerLate).not.toBeNull());
  vi.stubGlobal("fetch", plain);
  await session.signOut();
  await session.signIn({ name: "anna", password: "x" });
  answerLate!(refused(401));
  expect((await late).kind).toBe("refused");
  expect(session.phase).toBe("in");
});

test("a role holds for its robot, and for all robots only without one", async () => {
  const engineer = { ...ANNA, role: "engineer", robot: "press-4" };
  const { session } = await begin("", () => Response.json(engineer));
  expect([session.has("operator", "press-4"), session.has("engineer", "press-4"), session.has("admin", "press-4")]).toEqual([true, true, false]);
  expect([session.has("engineer", "press-5"), session.has("engineer", null)]).toEqual([false, false]);
});

test("a one-time link asks for a password before anything else, and leads to the sign-in", async () => {
  const { session, asked } = await begin("#link=5d0c&ben", () => refused(401));
  expect([session.phase, session.link, asked.length]).toEqual(["link", { secret: "5d0c", name: "ben" }, 0]);
  vi.stubGlobal("location", { hash: "", pathname: "/", search: "" });
  await session.leaveLink("ben");
  expect([session.phase, session.link, session.welcome]).toEqual(["out", null, "ben"]);
  const first = await begin("#link=5d0c", () => Response.json(ANNA));
  expect(first.session.link).toEqual({ secret: "5d0c", name: null });
  // The session of somebody else in this browser goes on.
  vi.stubGlobal("location", { hash: "", pathname: "/", search: "" });
  await first.session.leaveLink("ben");
  expect([first.session.phase, first.session.session?.user]).toEqual(["in", "anna"]);
});

test("a link that is opened in the tab of the page is taken out of the address, and signs in as at the start", async () => {
  let isOpen = false;
  const { session, asked } = await begin("", ({ method }) => {
    if (method === "POST") isOpen = true;
    return isOpen ? Response.json(TOKEN_7) : refused(401);
  });
  expect(session.phase).toBe("out");
  const kept = vi.fn();
  vi.stubGlobal("history", { replaceState: kept });
  const open = (hash: string) => vi.stubGlobal("location", { hash, pathname: "/", search: "?q=a" });
  open(`#${LINK}`);
  await session.follow();
  expect([session.phase, asked.at(-1)?.path, kept.mock.calls]).toEqual(["in", "/v1/session/link", [[null, "", "/?q=a"]]]);
  // While a session is open, the link of another one is asked about, and a text that is no link changes nothing.
  open("#something");
  await session.follow();
  expect([session.phase, kept.mock.calls.length]).toEqual(["in", 2]);
  open("");
  await session.follow();
  expect(kept.mock.calls.length).toBe(2);
  open("#link=5d0c&ben");
  await session.follow();
  expect([session.phase, session.link?.name, kept.mock.calls.length]).toEqual(["link", "ben", 3]);
});

test("a link that is opened while the gateway does not answer ends no session", async () => {
  let isThere = true;
  const { session } = await begin("", () => (isThere ? Response.json(ANNA) : null));
  isThere = false;
  vi.stubGlobal("location", { hash: `#${TOKEN}`, pathname: "/", search: "" });
  await session.follow();
  expect([session.phase, session.session?.user]).toEqual(["in", "anna"]);
});

test("after the gateway changed the role of a person, the page uses the new one", async () => {
  let told: object = ANNA;
  const { session, asked } = await begin("", () => Response.json(told));
  expect(session.has("admin", null)).toBe(true);
  const now = vi.spyOn(performance, "now").mockReturnValue(performance.now() + 61_000);
  // Another tab signed somebody else in.
  told = TOKEN_7;
  session.use();
  await vi.waitFor(() => expect(asked.length).toBe(2));
  await new Promise((next) => setTimeout(next, 10));
  expect(session.session?.user).toBe("anna");
  told = { ...ANNA, role: "viewer" };
  now.mockReturnValue(performance.now() + 61_000);
  session.use();
  await vi.waitFor(() => expect(session.has("operator", null)).toBe(false));
  vi.restoreAllMocks();
});
