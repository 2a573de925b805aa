/** Who did something, as the gateway names them. */

/** The token in such a name: `token 2 (ann)`, or its number alone. Names of users begin with a letter; `null` for them. */
export function tokenOf(actor: string): { number: number; name: string } | null {
  const [, number, name = ""] = /^(?:token )?(\d+)( \(.*\))?$/.exec(actor) ?? [];
  return number === undefined ? null : { number: Number(number), name };
}
