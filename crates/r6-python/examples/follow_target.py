"""Follows a moving target, with its position 20 times a second. Ctrl-C stops the arm.

The arm moves: J1 follows a target that swings by 15 degrees around the present position.

The protocol has no command to follow: replacing the list of a moving arm raises an alarm, and small steps
without a pause have overloaded the servos of a real arm (reported). So each step is 1 to 10 degrees, goes
at 20 %, and is sent only while the arm stands. The newest target counts; older ones are skipped.

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
    """The present target. In a cell it comes from a camera or a conveyor."""
    return r6.AxisPosition.degrees([middle + 15.0 * math.sin(time)])


async def main(address: str) -> None:
    """Follows, then waits until the arm stands. After any error the arm is stopped."""
    async with r6.AsyncRobot.connect(address) as robot:
        middle = float((await robot.status()).axes[0])
        loop = asyncio.get_running_loop()
        begun = loop.time()
        async with robot.follow(r6.FollowOptions(speed=r6.Percent(20), smallest_step=r6.Degrees(1))) as following:
            while (time := loop.time() - begun) < SECONDS + STANDS:
                # Send the target also when it has not moved, because it counts only for half a second.
                following.target(target(middle, min(time, SECONDS)))
                await asyncio.sleep(EVERY)
        followed = await following.finished()
        behind = "not known how far" if followed.behind is None else f"{followed.behind:.2f} deg"
        print(f"{followed.steps} steps, the arm stands at {followed.axes[0]:.2f}, {behind} behind")


with addresses() as (address,):
    asyncio.run(main(address))
