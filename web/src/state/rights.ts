/** The robots that a token or a user is for. */

/** Their names. `robots`: as the API has them, with commas between the names; `null` for all robots, which have no names here. */
export function namesOf(robots: string | null): string[] {
  return robots === null || robots === "" ? [] : robots.split(",");
}

/** Whether they are for this robot; `null` is all robots. */
export function covers(robots: string | null, robot: string | null): boolean {
  return robots === null || (robot !== null && namesOf(robots).includes(robot));
}
