/** Which steps of a program are to run, counted from 0. */
export type Scope = { kind: "all" } | { kind: "from"; step: number } | { kind: "one"; step: number };

/** The first step, and the one behind the last. */
export function range(scope: Scope, steps: number): [number, number] {
  if (scope.kind === "all") return [0, steps];
  const begin = Math.min(scope.step, steps);
  return scope.kind === "from" ? [begin, steps] : [begin, Math.min(begin + 1, steps)];
}
