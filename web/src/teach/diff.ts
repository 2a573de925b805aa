/** The difference between two texts, line by line. */

export interface DiffLine {
  kind: "same" | "added" | "removed";
  text: string;
}

/** Longer changed parts are shown as removed and added as a whole: the time grows with the product. */
const MAX_PRODUCT = 4_000_000;

/** What makes the second text of the first. */
export function diff(before: string, after: string): DiffLine[] {
  const [old, now] = [lines(before), lines(after)];
  let begin = 0;
  while (begin < old.length && begin < now.length && old[begin] === now[begin]) begin += 1;
  let end = 0;
  while (end < old.length - begin && end < now.length - begin && old.at(-1 - end) === now.at(-1 - end)) end += 1;
  const same = (text: string): DiffLine => ({ kind: "same", text });
  return [
    ...old.slice(0, begin).map(same),
    ...middle(old.slice(begin, old.length - end), now.slice(begin, now.length - end)),
    ...old.slice(old.length - end).map(same),
  ];
}

function lines(text: string): string[] {
  return text === "" ? [] : text.replace(/\n$/, "").split("\n");
}

/** By the longest common part. */
function middle(old: string[], now: string[]): DiffLine[] {
  const removed = (text: string): DiffLine => ({ kind: "removed", text });
  const added = (text: string): DiffLine => ({ kind: "added", text });
  if (old.length * now.length > MAX_PRODUCT) return [...old.map(removed), ...now.map(added)];
  const wide = now.length + 1;
  const longest = new Uint32Array((old.length + 1) * wide);
  for (let a = old.length - 1; a >= 0; a -= 1) {
    for (let b = now.length - 1; b >= 0; b -= 1) {
      longest[a * wide + b] =
        old[a] === now[b]
          ? longest[(a + 1) * wide + b + 1]! + 1
          : Math.max(longest[(a + 1) * wide + b]!, longest[a * wide + b + 1]!);
    }
  }
  const out: DiffLine[] = [];
  let [a, b] = [0, 0];
  while (a < old.length && b < now.length) {
    if (old[a] === now[b]) {
      out.push({ kind: "same", text: old[a]! });
      a += 1;
      b += 1;
    } else if (longest[(a + 1) * wide + b]! >= longest[a * wide + b + 1]!) {
      out.push(removed(old[a]!));
      a += 1;
    } else {
      out.push(added(now[b]!));
      b += 1;
    }
  }
  return [...out, ...old.slice(a).map(removed), ...now.slice(b).map(added)];
}

/** The lines that changed, with some around them; `null` stands for lines that are left out. */
export function changed(all: DiffLine[], around = 3): (DiffLine | null)[] {
  const shown = all.map((_, at) => all.slice(Math.max(0, at - around), at + around + 1).some(({ kind }) => kind !== "same"));
  return all.flatMap((line, at) => (shown[at] ? [line] : at === 0 || shown[at - 1] ? [null] : []));
}
