import { expect, test } from "vitest";
import { diff, changed } from "./diff.ts";
import { Drafted, type Shelf, MAX_CHARACTERS, MAX_DRAFTS, drafts, dropDraft, keepDraft, readDraft } from "./draft.ts";

function shelf(): Shelf & { kept: Map<string, string> } {
  const kept = new Map<string, string>();
  return {
    kept,
    get length() {
      return kept.size;
    },
    key: (at) => [...kept.keys()][at] ?? null,
    getItem: (key) => kept.get(key) ?? null,
    setItem: (key, text) => void kept.set(key, text),
    removeItem: (key) => void kept.delete(key),
  };
}

const draft = (text: string, at: number) => ({ text, at, base: { version: 2, etag: '"2-x"' } });

test("a draft is kept, read, and dropped", () => {
  const here = shelf();
  expect(keepDraft(here, "pick", draft("a", 1))).toBe(true);
  expect(readDraft(here, "pick")).toEqual(draft("a", 1));
  expect(readDraft(here, "place")).toBeNull();
  dropDraft(here, "pick");
  expect(drafts(here)).toEqual([]);
});

test("there are few drafts, and the oldest goes first", () => {
  const here = shelf();
  here.setItem("r6-theme", "dark");
  for (let at = 0; at < MAX_DRAFTS + 3; at += 1) keepDraft(here, `p${at}`, draft("x", at));
  expect(drafts(here).map(({ program }) => program)).toEqual(
    Array.from({ length: MAX_DRAFTS }, (_, at) => `p${MAX_DRAFTS + 2 - at}`),
  );
  keepDraft(here, "long", draft("x".repeat(MAX_CHARACTERS - 2), 99));
  expect(drafts(here).map(({ program }) => program)).toEqual(["long", "p22", "p21"]);
  expect(here.getItem("r6-theme")).toBe("dark");
});

test("a text that is not a draft is not read as one, and a browser that cannot keep a draft says so", () => {
  const here = shelf();
  for (const text of ["", "no json", "null", "[]", '{"text":1,"at":1,"base":null}', '{"text":"","at":1,"base":{}}']) {
    here.setItem("r6-draft-x", text);
    expect(readDraft(here, "x"), text).toBeNull();
  }
  const none = { ...shelf(), setItem: () => { throw new Error("full"); } };
  expect(keepDraft(none, "x", draft("a", 1))).toBe(false);
});

test("the difference of two texts rebuilds both", () => {
  const texts = ["", "a\n", "a\nb\nc\nd\n", "a\nx\nc\nd\n", "b\nc\na\nd\ne\n", "d\nc\nb\na\n"];
  for (const before of texts) {
    for (const after of texts) {
      const lines = diff(before, after);
      const side = (kind: "added" | "removed"): string =>
        lines.filter((line) => line.kind !== kind).map(({ text }) => `${text}\n`).join("");
      expect([side("added"), side("removed")]).toEqual([before, after]);
    }
  }
  expect(diff("a\nb\nc", "a\nc").map(({ kind }) => kind)).toEqual(["same", "removed", "same"]);
});

test("lines far from a change are left out", () => {
  const text = Array.from({ length: 20 }, (_, at) => `line ${at}\n`).join("");
  const shown = changed(diff(text, text.replace("line 10\n", "line ten\n")), 1);
  expect(shown.map((line) => line?.text ?? null)).toEqual([null, "line 9", "line 10", "line ten", "line 11", null]);
  expect(changed(diff(text, text))).toEqual([null]);
});

test("of two pages with one program, neither takes the draft of the other away without a word", () => {
  const here = shelf();
  const [one, two] = [new Drafted(here, "pick"), new Drafted(here, "pick")];
  expect([one.read(), two.read()]).toEqual([null, null]);
  expect(one.keep(draft("a", 1))).toBe(true);
  expect([one.isOthers("a"), two.isOthers("b"), two.isOthers("a")]).toEqual([false, true, false]);
  expect(two.keep(draft("b", 2))).toBe(false);
  expect(readDraft(here, "pick")?.text).toBe("a");
  // What the other page saves or discards drops its own draft alone.
  two.drop("b");
  expect(readDraft(here, "pick")?.text).toBe("a");
  expect(two.keep(draft("b", 3), true)).toBe(true);
  expect([one.isOthers("a"), one.keep(draft("a2", 4))]).toEqual([true, false]);
  two.drop("b");
  expect(readDraft(here, "pick")).toBeNull();
  expect(one.keep(draft("a3", 5))).toBe(true);
  const key = [...here.kept.keys()][0]!;
  expect([one.isOf({ key }), one.isOf({ key: "r6-theme" })]).toEqual([true, false]);
});
