"""Follows a target that moves, and is told 20 times a second where it is. Ctrl-C stops the arm.

The arm moves: J1 follows a target that sways by 15 degrees around where it is.

The protocol cannot follow: replacing the list of an arm that moves raises an alarm, and small steps without a pause have
overloaded the servos of a real arm (reported). So each step is at least 1 degree and at most 10, goes at 20 %, and is sent
only while the arm stands; the newest target counts, and those in between are skipped.

python follow_target.py [HOST:PORT]
"""

import asyncio
import math

from _address import addresses

import r6

EVERY = 0.05
SECONDS = 3.0
STANDS = 2.0
"""How long the target stands at the end, so that the arm arrives."""


def target(middle: float, time: float) -> r6.AxisPosition:
    """Where the target is. In a cell a camera or a conveyor tells."""
    return r6.AxisPosition.degrees([middle + 15.0 * math.sin(time)])


async def main(address: str) -> None:
    """Follows, then waits until the arm stands. Whatever goes wrong, the arm is stopped."""
    async with r6.AsyncRobot.connect(address) as robot:
        middle = float((await robot.status()).axes[0])
        loop = asyncio.get_running_loop()
        begun = loop.time()
        async with robot.follow(r6.FollowOptions(speed=r6.Percent(20), smallest_step=r6.Degrees(1))) as following:
            while (time := loop.time() - begun) < SECONDS + STANDS:
                # Also when it has not moved: a target that is not told any more is followed no more.
                following.target(target(middle, min(time, SECONDS)))
                await asyncio.sleep(EVERY)
        followed = await following.finished()
        behind = "not known how far" if followed.behind is None else f"{followed.behind:.2f} deg"
        print(f"{followed.steps} steps, the arm stands at {followed.axes[0]:.2f}, {behind} behind")


with addresses() as (address,):
    asyncio.run(main(address))
