/** What the gateway reads of a robot besides what it reads of every robot. */
import type { PollGroup } from "../api/types.ts";

const USUAL = new Set(["curMode", "curAlarm", "isMoving", "origin", "RemoteCmdLen", "curMold", "curCycle", "lastCycle"]);

/** The addresses that are read besides those of every robot and of groups: the API tells only all that are read. */
export function extra(addresses: Iterable<string>, groups: readonly PollGroup[]): string[] {
  const known = new Set([...USUAL, ...groups.flatMap((group) => group.read)]);
  return [...addresses].filter((address) => !known.has(address) && !/^(axis|world)-[0-5]$/.test(address));
}
