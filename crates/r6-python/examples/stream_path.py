"""Streams a path of 500 points, which the controller takes in lists of a few instructions, without a pause
between them. Ctrl-C stops the arm.

The arm moves: J1 swings by 20 degrees around the present position, J2 goes 20 degrees further and comes
back. Read docs/SAFETY.md first. So many points take time at any speed (docs/FIDELITY.md): if you need
speed, send fewer.

python stream_path.py [HOST:PORT]
"""

import numpy as np
from _address import addresses

import r6

turn = np.linspace(0.0, 2.0 * np.pi, 500)

with addresses() as (address,), r6.Robot.connect(address) as robot:
    # A path from the present position and back to it.
    path = np.tile(robot.status().axes[:6], (len(turn), 1))
    path[:, 0] += 20.0 * np.sin(turn)
    path[:, 1] += 10.0 * (1.0 - np.cos(turn))
    with robot.run(r6.Motion().axis_path(path, r6.Percent(50), blend=5)) as moving:
        for progress in moving:
            print(f"\r{progress.done} of {progress.total} points", end="", flush=True)
        done = moving.finished()
    error = np.abs(done.axes[:6] - path[-1]).max()
    print(f"\nat the end after {done.took:.1f} s, {error:.4f} deg from the last point")
