"""The round trip of a poll through asyncio: r6 and pymodbus.

    python modbus.py MODBUS_HOST:PORT ROBOT_HOST:PORT

Run by `make bench ARGS=modbus` against servers that answer every request with the same values. Each line
of the input names a contender. That contender then runs for a slice of 0.2 s, and its median is printed,
nanoseconds.
"""

import asyncio
import statistics
import sys
import time
from collections.abc import Awaitable, Callable

from pymodbus.client import AsyncModbusTcpClient

import r6

SLICE = 0.2  # seconds

ADDRESSES = [f"{kind}-{number}" for kind in ("axis", "world") for number in range(6)]

Poll = Callable[[], Awaitable[None]]


async def with_pymodbus(address: str) -> Poll:
    """Polls twelve holding registers."""
    host, port = address.rsplit(":", 1)
    client = AsyncModbusTcpClient(host, port=int(port))
    assert await client.connect()

    async def poll() -> None:
        registers = (await client.read_holding_registers(0, count=12)).registers
        assert len(registers) == 12

    return poll


async def with_r6(address: str) -> Poll:
    """Polls twelve addresses."""
    robot = await r6.AsyncRobot.connect(address)

    async def poll() -> None:
        assert isinstance((await robot.query(*ADDRESSES))["axis-0"], float)

    return poll


async def one_slice(poll: Poll) -> float:
    """The median of a slice, nanoseconds."""
    durations = []
    last = begun = time.perf_counter_ns()
    while last - begun < SLICE * 1e9:
        await poll()
        now = time.perf_counter_ns()
        durations.append(now - last)
        last = now
    return statistics.median(durations)


async def main() -> None:
    """Measures the contenders that the input names."""
    polls = {"pymodbus": await with_pymodbus(sys.argv[1]), "r6": await with_r6(sys.argv[2])}
    for poll in polls.values():
        await one_slice(poll)
    for line in sys.stdin:
        print(await one_slice(polls[line.strip()]), flush=True)


if __name__ == "__main__":
    asyncio.run(main())
