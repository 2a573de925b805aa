import { expect, test } from "vitest";
import { routeOf } from "../route.ts";
import { clock, minutes } from "../i18n/format.ts";
import { problemOf } from "./client.ts";
import { secretOf } from "./secret.ts";

test("a token and the secret of a link are read, and nothing else is", () => {
  const long = `r6_${"00ff10fb".repeat(8)}`;
  // The same bytes, as Python's base64.urlsafe_b64encode writes them, without `=`.
  const short = "AP8Q-wD_EPsA_xD7AP8Q-wD_EPsA_xD7AP8Q-wD_EPs";
  expect(secretOf(` ${long}\n`)).toEqual({ token: long });
  expect(secretOf(short)).toEqual({ secret: long.slice(3) });
  for (const wrong of ["", "r6_00", long.toUpperCase(), short.slice(1), `${short}=`, "a b"]) {
    expect(secretOf(wrong), wrong).toBeNull();
  }
});

test("an answer that is no problem is told by its status", () => {
  expect(problemOf('{"code":"leased","message":"held"}', 409)).toEqual({ code: "leased", message: "held" });
  for (const text of ["", "<html>", "null", "[]", "{}"]) {
    expect(problemOf(text, 502)).toEqual({ code: "unknown", message: "HTTP 502" });
  }
});

test("the pages have addresses", () => {
  expect(routeOf("/")).toEqual({ page: "hall" });
  expect(routeOf("/robots/press-4")).toEqual({ page: "robot", robot: "press-4" });
  expect(routeOf("/robots/a%20b")).toEqual({ page: "robot", robot: "a b" });
  for (const path of ["/robots/", "/robots/a/b", "/robots/%FF", "/setup"]) {
    expect(routeOf(path), path).toEqual({ page: "unknown" });
  }
});

test("times are those of the hall", () => {
  const at = Date.parse("2026-11-25T23:30:05Z");
  expect(clock(at, "Europe/Berlin", at)).toBe("00:30:05");
  expect(clock(at, "UTC", at + 3_600_000)).toBe("2026-11-25 23:30:05");
  expect([0, 4_100, 272_000].map(minutes)).toEqual(["0:00", "0:05", "4:32"]);
});
