import { afterEach, expect, test, vi } from "vitest";
import { stops } from "../stop/stops.ts";
import { call } from "./client.ts";

afterEach(() => vi.unstubAllGlobals());

test("beside a stop there is one question at a time, and what a person does does not wait", async () => {
  const sent: { path: string; answer(): void }[] = [];
  vi.stubGlobal("fetch", (path: string) => {
    return new Promise<Response>((done) => sent.push({ path, answer: () => done(Response.json({ confirmed: true, took_ms: 1 })) }));
  });
  const settled = (): Promise<void> => new Promise((next) => setTimeout(next));
  const paths = (): string[] => sent.map(({ path }) => path);
  for (const path of ["/1", "/2", "/3", "/4"]) void call("GET", path);
  await settled();
  expect(paths()).toEqual(["/1", "/2", "/3"]);
  stops.one("saw", { csrf: null, isLost: false });
  expect(paths().at(-1)).toBe("/v1/robots/saw/stop");
  void call("POST", "/5");
  expect(paths().at(-1)).toBe("/5");
  sent[0]?.answer();
  sent[1]?.answer();
  await settled();
  expect(paths()).not.toContain("/4");
  sent[2]?.answer();
  await settled();
  expect(paths().at(-1)).toBe("/4");
  void call("GET", "/6");
  await settled();
  expect(paths()).not.toContain("/6");
  sent[3]?.answer();
  await settled();
  expect(paths().at(-1)).toBe("/6");
});
