/** A gateway with virtual robots, as a test wants them. */
import { writeFileSync } from "node:fs";
import { join } from "node:path";
import { Running, folder, hasThisPage, r6 } from "./support.ts";

export interface Made {
  url: string;
  /** The panel of the robots, in the order of their names: `r6 panel --controller N`. */
  panel: string;
  /** A token of this role. */
  token(role: string): Promise<string>;
  end(): Promise<void>;
}

interface Wanted {
  names: string[];
  /** Names of robots with an older firmware, whose counters are not read. */
  old?: string[];
  /** The program that the robots run, in TOML; a usual one if it is missing. */
  program?: string;
  /** Further words for `r6 sim` of the robots of `names`, such as a model. */
  sim?: string[];
  /** What else is in the file of the gateway. */
  more: string;
}

export async function make({ names, old = [], program, sim: words = [], more }: Wanted): Promise<Made> {
  const data = folder();
  const listen = (of: string[]): string[] => of.flatMap(() => ["--listen", "127.0.0.1:0"]);
  const taught = join(data.path, "taught.toml");
  if (program !== undefined) writeFileSync(taught, program);
  const runs = program === undefined ? [] : ["--program", taught];
  const sims = [new Running("sim", ...listen(names), "--panel", "127.0.0.1:0", ...runs, ...words)];
  if (old.length > 0) sims.push(new Running("sim", ...listen(old), "--profile", "legacy"));
  const addresses = await Promise.all(sims.map((sim, at) => sim.all(/listening on (\S+)/g, [names, old][at]?.length ?? 0)));
  const robot = (name: string, at: number, of: number): string =>
    `[[robot]]\nname = "${name}"\naddress = "${addresses[of]?.[at]}"\n${of === 0 ? 'read = ["counter-0"]\n' : ""}`;
  const file = join(data.path, "hall.toml");
  const robots = [...names.map((name, at) => robot(name, at, 0)), ...old.map((name, at) => robot(name, at, 1))];
  writeFileSync(file, `${robots.join("\n")}\n${more}`);
  const folderOf = join(data.path, "data");
  const gateway = new Running("gateway", "--listen", "127.0.0.1:0", "--data", folderOf, "--config", file);
  const url = await gateway.said(/gateway on (http:\/\/[^\s,]+)/);
  await hasThisPage(url);
  return {
    url,
    panel: (await sims[0]?.said(/panel on http:\/\/(\S+)/)) ?? "",
    token: async (role) => (await r6("gateway", "token", "--data", folderOf, "--role", role)).trim(),
    end: async () => {
      await gateway.kill();
      await Promise.all(sims.map((sim) => sim.kill()));
      data.remove();
    },
  };
}
