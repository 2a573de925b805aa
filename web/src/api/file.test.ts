import { afterEach, expect, test, vi } from "vitest";
import { call, file } from "./client.ts";

afterEach(() => vi.unstubAllGlobals());

test("a question that nothing waits for is given up: before it is sent, and under way", async () => {
  const sent: string[] = [];
  vi.stubGlobal("fetch", (path: string, { signal }: { signal: AbortSignal }) => {
    sent.push(path);
    return new Promise<Response>((_, fail) => signal.addEventListener("abort", () => fail(new Error("aborted"))));
  });
  const stop = new AbortController();
  const all = ["/1", "/2", "/3", "/4"].map((path) => call("GET", path, { signal: stop.signal }));
  await new Promise((next) => setTimeout(next));
  expect(sent).toEqual(["/1", "/2", "/3"]);
  stop.abort();
  expect((await Promise.all(all)).map(({ kind }) => kind)).toEqual(Array(4).fill("unknown"));
  expect(sent).toHaveLength(3);
});

test("a file comes in the form that was asked for, and says where to read on", async () => {
  const accepted: string[] = [];
  vi.stubGlobal("fetch", (path: string, { headers }: { headers: Record<string, string> }) => {
    accepted.push(headers["Accept"] ?? "");
    if (path === "/no") return Promise.resolve(Response.json({ code: "bad_value", message: "no" }, { status: 422 }));
    return Promise.resolve(new Response("a,b\r\n1,2\r\n", { headers: path === "/last" ? {} : { "r6-next-cursor": "t7" } }));
  });
  const answer = await file("/1", "text/csv");
  expect(answer.kind === "ok" && [await answer.value.bytes.text(), answer.value.next]).toEqual(["a,b\r\n1,2\r\n", "t7"]);
  expect(await file("/last", "text/csv")).toMatchObject({ value: { next: null } });
  expect(await file("/no", "text/csv")).toEqual({ kind: "refused", status: 422, problem: { code: "bad_value", message: "no" } });
  expect(accepted).toEqual(Array(3).fill("text/csv"));
});
