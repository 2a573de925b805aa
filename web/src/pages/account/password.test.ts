import { expect, test } from "vitest";
import { isPassword, isUserName, newPassword } from "./password.ts";

test("a new password is long enough, and each character has as many chances", () => {
  const password = newPassword((bytes) => bytes.map((_, at) => at));
  expect(password).toBe("abcde-fghij-kmnpq-rstuv");
  expect(isPassword(password)).toBe(true);
  // 256 is a multiple of the number of characters, so none comes more often.
  const drawn = new Set(Array.from({ length: 256 }, (_, byte) => newPassword((bytes) => bytes.fill(byte))[0]));
  expect(256 % drawn.size).toBe(0);
});

test("lengths are counted in characters, as the gateway counts them", () => {
  expect(["密".repeat(11), "密".repeat(12), "😀".repeat(128), "😀".repeat(129)].map(isPassword)).toEqual([false, true, true, false]);
});

test("names of users", () => {
  expect(["anna", "a", "ben.2_x-y", "a".repeat(64)].every(isUserName)).toBe(true);
  expect(["", "Anna", "2ben", "raw", "gateway", "a b", "a".repeat(65)].some(isUserName)).toBe(false);
});
