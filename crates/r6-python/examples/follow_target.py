"""Follows a target that moves, with 20 new points a second.

The controller has a list and no servo interface: each new point is appended to it as soon as no more than two steps are
left, so the arm is behind by as much as it takes for two short steps, and does not stop in between.

python follow_target.py [HOST:PORT]
"""

import asyncio

import numpy as np
from _address import addresses

import r6

EVERY = 0.05
SECONDS = 3.0
FAST = r6.Percent(80)


def target(time: float) -> r6.AxisPosition:
    """Where the target is: a slow circle of two axes."""
    return r6.AxisPosition.degrees([8.0 * np.sin(time), 8.0 * (1.0 - np.cos(time)), 0.0, 0.0, 30.0, 0.0])


async def follow(robot: r6.AsyncRobot) -> int:
    """Sends the target 20 times a second; how many points it sent."""
    first = await robot.run(r6.Motion().axis_move(target(0.0), FAST))
    await first.finished()
    loop = asyncio.get_running_loop()
    begun = loop.time()
    sent = 0
    state = robot.subscribe("RemoteCmdLen", "curAlarm", "axis-0", every=EVERY)
    async with state:
        async for snapshot in state:
            now = loop.time() - begun
            if now >= SECONDS:
                break
            if snapshot.fresh("curAlarm") != 0:
                raise RuntimeError(f"alarm {snapshot['curAlarm'].reading}")
            left = snapshot.fresh("RemoteCmdLen")
            if isinstance(left, int) and left <= 2:
                await robot.add_rcc(r6.Motion().axis_move(target(now), FAST).blend(3), replace=False)
                sent += 1
    return sent


async def main(address: str) -> None:
    """Follows, then waits for the rest. Whatever goes wrong, the arm is stopped."""
    async with await r6.AsyncRobot.connect(address) as robot:
        try:
            sent = await follow(robot)
            done = await robot.wait_until_done(timeout=10.0)
        except BaseException:
            print(await robot.stop())
            raise
        print(f"sent {sent} points, the arm stands at {done.axes.round(2)} deg")


with addresses() as (address,):
    asyncio.run(main(address))
