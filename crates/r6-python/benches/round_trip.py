"""The round trip of a query of twelve addresses: r6 beside hand-written socket and json code.

    python round_trip.py HOST:PORT

Run by `make bench ARGS=python` against a server that answers every query with the same values. The two
take turns, a slice of 0.2 s each, for fifteen rounds. Prints one JSON object: the median of each slice,
nanoseconds, and the first value that both read.
"""

import itertools
import json
import socket
import statistics
import sys
import time
from collections.abc import Callable

import r6

ROUNDS = 15
SLICE = 0.2  # seconds

ADDRESSES = [f"{kind}-{number}" for kind in ("axis", "world") for number in range(6)]


def by_hand(address: str) -> Callable[[], float]:
    """A usual script: a request from a dict, `recv` until the object is complete, the values as floats."""
    host, port = address.rsplit(":", 1)
    connection = socket.create_connection((host, int(port)))
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    numbers = itertools.count(1)

    def query() -> float:
        number = str(next(numbers))
        request = {
            "dsID": "www.hc-system.com.RemoteMonitor",
            "reqType": "query",
            "packID": number,
            "queryAddr": ADDRESSES,
        }
        connection.sendall(json.dumps(request, separators=(",", ":")).encode())
        received = b""
        while not received.endswith(b"}"):
            received += connection.recv(4096)
        reply = json.loads(received)
        assert reply["packID"] == number
        values = dict(zip(reply["queryAddr"], map(float, reply["queryData"]), strict=True))
        return values["axis-0"]

    return query


def with_r6(address: str) -> Callable[[], float]:
    """The same with the package."""
    robot = r6.Robot.connect(address)

    def query() -> float:
        value = robot.query(*ADDRESSES)["axis-0"]
        assert isinstance(value, float)
        return value

    return query


def one_slice(query: Callable[[], float]) -> float:
    """The median of a slice, nanoseconds."""
    durations = []
    last = begun = time.perf_counter_ns()
    while last - begun < SLICE * 1e9:
        query()
        now = time.perf_counter_ns()
        durations.append(now - last)
        last = now
    return statistics.median(durations)


def main() -> None:
    """Measures, and prints the result."""
    address = sys.argv[1]
    contenders = {"by_hand": by_hand(address), "r6": with_r6(address)}
    read = {name: query() for name, query in contenders.items()}
    for query in contenders.values():
        one_slice(query)
    rounds = []
    for number in range(ROUNDS):
        names = list(contenders) if number % 2 else list(reversed(contenders))
        rounds.append({name: one_slice(contenders[name]) for name in names})
    print(json.dumps({"read": read, "rounds": rounds}))


if __name__ == "__main__":
    main()
