import { expect, test, vi } from "vitest";
import type { Answer } from "../../api/client.ts";
import type { StoredProgram } from "../../api/types.ts";

const asked: string[] = [];
let answer: Answer<StoredProgram> = { kind: "unknown" };
vi.mock("../../api/client.ts", () => ({
  call: async (_method: string, path: string) => {
    asked.push(path);
    return answer;
  },
}));
const { stored } = await import("./stored.ts");

const refused = (status: number): Answer<StoredProgram> => ({
  kind: "refused",
  status,
  problem: { code: "no_such_program", message: "" },
});
const kept = (version: number, program: string): Answer<StoredProgram> => ({
  kind: "ok",
  value: { version, program } as StoredProgram,
});

test("a kept program counts as checked only if the number and the text of its latest version are those that were checked", async () => {
  const rows: [Answer<StoredProgram>, string][] = [
    [kept(1, "a"), "same"],
    // Removed and stored anew: the number is the same.
    [kept(1, "b"), "another"],
    [kept(2, "a"), "another"],
    [refused(404), "another"],
    [refused(429), "no_answer"],
    [{ kind: "unknown" }, "no_answer"],
  ];
  for (const [given, expected] of rows) {
    answer = given;
    expect(await stored({ name: "pick/1", version: 1 }, "a", new AbortController().signal), JSON.stringify(given)).toBe(expected);
  }
  expect(new Set(asked), "the latest version").toEqual(new Set(["/v1/programs/pick%2F1"]));
});
