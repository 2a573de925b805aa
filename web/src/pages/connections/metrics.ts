/** Numbers of the gateway, from the text of `GET /metrics`. */

export interface Sample {
  name: string;
  labels: Record<string, string>;
  value: number;
}

/** Lines that cannot be read are left out. */
export function samplesIn(text: string): Sample[] {
  const samples: Sample[] = [];
  for (const line of text.split("\n")) {
    const [, name = "", labels = "", value = ""] = /^([a-z0-9_]+)(?:\{([^}]*)\})? (\S+)$/.exec(line) ?? [];
    if (name === "" || Number.isNaN(Number(value))) continue;
    const pairs = [...labels.matchAll(/([a-z0-9_]+)="([^"]*)"/g)].map(([, key = "", of = ""]) => [key, of]);
    samples.push({ name, labels: Object.fromEntries(pairs) as Record<string, string>, value: Number(value) });
  }
  return samples;
}

/** What is counted of one robot since the gateway started or the robot was added; `null` where it is not told. */
export interface Counts {
  requests: number | null;
  replies: number | null;
  timeouts: number | null;
  reconnects: number | null;
  rawClients: number | null;
  rawRefused: number | null;
  rawClosed: number | null;
  samplesLost: number | null;
  waiting: number | null;
}

export function countsOf(samples: readonly Sample[], robot: string): Counts {
  const of = (name: string): number | null => {
    const own = samples.filter((sample) => sample.name === `r6_gateway_${name}` && sample.labels["robot"] === robot);
    return own.length === 0 ? null : own.reduce((sum, sample) => sum + sample.value, 0);
  };
  return {
    requests: of("robot_requests_total"),
    replies: of("robot_replies_total"),
    timeouts: of("robot_timeouts_total"),
    reconnects: of("robot_reconnects_total"),
    rawClients: of("raw_clients"),
    rawRefused: of("raw_refused_total"),
    rawClosed: of("raw_closed_total"),
    samplesLost: of("history_lost_total"),
    waiting: of("records_waiting"),
  };
}

/** A number of the gateway itself; `null` if it is not told. */
export function ofGateway(samples: readonly Sample[], name: string): number | null {
  return samples.find((sample) => sample.name === `r6_gateway_${name}` && sample.labels["robot"] === undefined)?.value ?? null;
}
