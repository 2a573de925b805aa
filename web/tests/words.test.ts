import { readFileSync, readdirSync } from "node:fs";
import { expect, test } from "vitest";
import { en } from "../src/i18n/en.ts";
import { audit as englishAudit } from "../src/i18n/en/audit.ts";
import { zh } from "../src/i18n/zh.ts";
import { audit as chineseAudit } from "../src/i18n/zh/audit.ts";

/** All texts of a language, by their place. Functions are called with the arguments of a robot that waits. */
function leaves(words: object, path = ""): [string, unknown][] {
  return Object.entries(words).flatMap(([key, value]): [string, unknown][] =>
    typeof value === "object" && value !== null ? leaves(value, `${path}${key}.`) : [[path + key, value]],
  );
}

test("each language has every text, and no text is left in English", () => {
  // The words of the audit log are in the chunk of its page.
  const english = new Map(leaves({ ...en, audit: englishAudit }));
  const chinese = leaves({ ...zh, audit: chineseAudit });
  expect(chinese.map(([place]) => place)).toEqual([...english.keys()]);
  const same = chinese.filter(([place, text]) => typeof text === "string" && text === english.get(place));
  // The name of the virtual robot says it in both languages, and a key is a key.
  expect(same.map(([place]) => place)).toEqual(["virtual", "stop.key"]);
});

test("numbers are counted as the language does it", () => {
  expect([en.counts.need(0), en.counts.need(1), en.counts.need(2)]).toEqual([
    "no robot needs a person",
    "1 needs a person",
    "2 need a person",
  ]);
  expect([0, 61, 3_700].map((seconds) => en.needs.since(seconds))).toEqual([
    "waits 0 s",
    "waits 1 min 1 s",
    "waits 1 h 1 min",
  ]);
  expect(zh.needs.since(61)).toBe("已等待 1 分 1 秒");
});

test("each kind of what a robot does has a sentence in both languages", () => {
  const none = { program: null, left: null };
  for (const words of [en, zh]) {
    const said = [
      words.doing({ kind: "no_link" }),
      words.doing({ kind: "other_robot", found: "B" }),
      words.doing({ kind: "not_read" }),
      words.doing({ kind: "alarm", code: 7, text: "emergency stop" }),
      words.doing({ kind: "stop_holds", stands: true, mine: false }),
      words.doing({ kind: "stop_holds", stands: false, mine: false }),
      words.doing({ kind: "stop_holds", stands: true, mine: true }),
      words.doing({ kind: "stop_holds", stands: false, mine: true }),
      words.doing({ kind: "manual" }),
      words.doing({ kind: "moves", ...none }),
      words.doing({ kind: "moves", program: "pick", left: 2 }),
      words.doing({ kind: "runs", ...none, stands: true }),
      words.doing({ kind: "runs", program: "pick", left: 2, stands: true }),
      words.doing({ kind: "runs", ...none, stands: false }),
      words.doing({ kind: "runs", program: "pick", left: 2, stands: false }),
      words.doing({ kind: "waits_for_start", stands: true }),
      words.doing({ kind: "waits_for_start", stands: false }),
      words.doing({ kind: "stopped", stands: true }),
      words.doing({ kind: "stopped", stands: false }),
      words.doing({ kind: "unknown_mode", mode: 5 }),
    ];
    expect(new Set(said).size).toBe(said.length);
    expect(said.join("")).not.toMatch(/undefined|null|\s[,.]/);
  }
});

test("that an arm stands is said only if it is seen, and each bad end of a stop names the emergency stop", () => {
  const kinds = ["stop_holds", "waits_for_start", "stopped", "runs"] as const;
  for (const kind of kinds) {
    expect(en.doing({ kind, program: null, left: null, mine: false, stands: false })).toMatch(/whether the arm (stands|moves now) is not known/i);
    expect(zh.doing({ kind, program: null, left: null, mine: false, stands: false })).toMatch(/未知。/);
    expect(en.doing({ kind, program: null, left: null, mine: false, stands: true })).not.toContain("not known");
  }
  for (const say of [en.stop.notConfirmed, en.stop.notSent]) expect(say).toContain("emergency stop");
  for (const say of [zh.stop.notConfirmed, zh.stop.notSent]) expect(say).toContain("急停");
  for (const why of ["no_answer", "no_gateway", "in_turn", "given_up", "not_stopped"]) {
    for (const words of [en, zh]) expect(words.stop.why(why)).not.toContain(why);
  }
});

test("the tokens of both themes have the same names, and their contrasts hold", () => {
  const css = readFileSync(new URL("../src/ui/tokens.css", import.meta.url), "utf8");
  const [light = "", dark = ""] = css.split('[data-theme="dark"]');
  const read = (text: string): Map<string, string> =>
    new Map([...text.matchAll(/--([a-z0-9-]+): (#[0-9a-f]{6});/g)].map(([, name = "", hex = ""]) => [name, hex]));
  const themes = [read(light), read(dark)] as const;
  expect([...themes[0].keys()]).toEqual([...themes[1].keys()]);
  const pairs: [string, string, number][] = [
    ["text", "surface", 7],
    ["muted", "surface", 4.5],
    ["muted", "raised", 4.5],
    ["stale", "raised", 4.5],
    ["edge", "surface", 3],
    ["accent", "surface", 4.5],
    ["s1-sign", "s1", 4.5],
    ["s2-sign", "s2", 4.5],
    ["text", "s1-fill", 4.5],
    ["text", "s2-fill", 4.5],
    ["virtual", "raised", 4.5],
    ["stop-text", "stop", 7],
  ];
  for (const theme of themes) {
    for (const [one, other, least] of pairs) {
      const ratio = contrast(theme.get(one) ?? "", theme.get(other) ?? "");
      expect(ratio, `${one} on ${other}`).toBeGreaterThanOrEqual(least);
    }
  }
});

function contrast(one: string, other: string): number {
  const light = (hex: string): number => {
    const parts = [1, 3, 5].map((at) => Number.parseInt(hex.slice(at, at + 2), 16) / 255);
    const [r = 0, g = 0, b = 0] = parts.map((part) => (part <= 0.03928 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const [a, b] = [light(one), light(other)];
  return (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
}

test("the stop imports nothing of the page's state", () => {
  for (const file of readdirSync(new URL("../src/stop/", import.meta.url))) {
    const text = readFileSync(new URL(`../src/stop/${file}`, import.meta.url), "utf8");
    const imports = [...text.matchAll(/from "(\.[^"]+)"/g)].map(([, path]) => path);
    const foreign = imports.filter((path) => !path?.startsWith("./"));
    if (!file.endsWith(".test.ts")) expect(foreign, file).toEqual([]);
  }
});

test("each event of the history has a sentence in both languages", () => {
  const at = { id: "1-1-1", time: "2026-11-25T06:00:00Z" };
  const events = [
    { ...at, event: "alarm_began", code: 7, text: "emergency stop", remedy: "" },
    { ...at, event: "alarm_ended", code: 7, text: "emergency stop", lasted_ms: 61_000 },
    { ...at, event: "alarm_ended", code: 7, text: "emergency stop", lasted_ms: null },
    { ...at, event: "mode_changed", from: 2, to: 7 },
    { ...at, event: "program_changed", from: "", to: "pick" },
    { ...at, event: "cycle_done", at: at.time, count: 1, at_least: false, ms: 12_400 },
    { ...at, event: "cycle_done", at: at.time, count: 2, at_least: true, ms: null },
    { ...at, event: "parts", counter: "counter-0", added: 1, total: 8 },
    { ...at, event: "parts_reset", counter: "counter-0", from: 8, to: 0 },
    { ...at, event: "link_lost" },
    { ...at, event: "link_back" },
    ...(["link", "late", "start", "lost", "unread", "another_robot"] as const).map((because) => ({ ...at, event: "unseen" as const, because, from: null, to: at.time })),
    { ...at, event: "unseen", because: "link", from: at.time, to: at.time },
  ] as const;
  for (const words of [en, zh]) {
    const said = events.map((event) => words.history.event(event, words.mode, () => "06:00:00"));
    expect(new Set(said).size).toBe(said.length);
    expect(said.join(" ")).not.toMatch(/undefined|null|_|\s[,.]/);
  }
  expect(en.history.event(events[1], en.mode, String)).toBe("Alarm 7 ended after 1 min 1 s: emergency stop");
  expect(zh.history.event(events[6], zh.mode, String)).toBe("至少完成 2 个循环");
});
