import { expect, test, vi } from "vitest";
import { pointsOf } from "../../teach/document.ts";

test("a document with points and no step is not checked, so it has no mistake", async () => {
  vi.useFakeTimers();
  vi.stubGlobal("location", { hash: "", pathname: "/", search: "", origin: "" });
  vi.stubGlobal("matchMedia", () => ({ matches: false, addEventListener: () => {} }));
  const asked: string[] = [];
  const POINT = '# point "above" = axes [0, 10, -20, 0, -80, 0] pose [360, -50, 500, 180, 0, 180]\n';
  let program = POINT;
  vi.doMock("../../api/client.ts", () => ({
    call: async (method: string, path: string) => {
      asked.push(`${method} ${path}`);
      if (method === "GET") return { kind: "ok", value: { version: 1, etag: '"1-a"', program } };
      return { kind: "ok", value: { ok: true, problems: [], remarks: [], more_problems: 0 } };
    },
    freshKey: () => "key",
    whenSignedOut: () => {},
  }));
  const { Editor } = await import("./editor.svelte.ts");
  const checks = async (): Promise<number> => {
    asked.length = 0;
    const editor = new Editor("p");
    await vi.advanceTimersByTimeAsync(5_000);
    expect([editor.phase, editor.raw, pointsOf(editor.document).length]).toEqual(["ready", null, 1]);
    editor.end();
    return asked.filter((one) => one === "POST /v1/programs/check").length;
  };
  expect(await checks()).toBe(0);
  program = `${POINT}\n[[instruction]]\ndo = "wait"\nseconds = 1\n`;
  expect(await checks()).toBe(1);
  vi.useRealTimers();
});
