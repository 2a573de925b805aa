/** The addresses of the API. */

/** The address of a robot, or of a part of it. */
export function robotPath(robot: string, part?: string): string {
  const path = `/v1/robots/${encodeURIComponent(robot)}`;
  return part === undefined ? path : `${path}/${part}`;
}
