"""Moves two robots at the same time, and continues when both have arrived. Ctrl-C stops both.

Both arms move: J1 by 20 degrees and back, from the present position. This program does not keep two arms
from colliding: read docs/SAFETY.md first.

python two_robots.py [HOST:PORT HOST:PORT]
"""

import asyncio

from _address import addresses

import r6


async def swing(robot: r6.AsyncRobot, angle: float) -> r6.Done:
    """Moves J1 there and back. The arm is stopped if the other robot fails."""
    speed = r6.Percent(30)
    j1 = float((await robot.status()).axes[0])
    motion = r6.Motion()
    for to in (j1 + angle, j1):
        # Axes that are not named do not move.
        motion = motion.axis_move(r6.AxisPosition.degrees([to]), speed)
    async with await robot.run(motion) as moving:
        return await moving.finished()


async def main(left_address: str, right_address: str) -> None:
    """Moves both at once."""
    async with r6.AsyncRobot.connect(left_address) as left:
        async with r6.AsyncRobot.connect(right_address) as right:
            swings = [asyncio.create_task(swing(left, 20)), asyncio.create_task(swing(right, -20))]
            try:
                ends = await asyncio.gather(*swings)
            finally:
                # If one fails, the other is stopped before the connections end.
                for other in swings:
                    other.cancel()
                await asyncio.gather(*swings, return_exceptions=True)
            for robot, end in zip((left, right), ends, strict=True):
                print(f"{robot.address} stands at {end.axes.round(3)} after {end.took:.2f} s")


with addresses(2) as (left, right):
    asyncio.run(main(left, right))
