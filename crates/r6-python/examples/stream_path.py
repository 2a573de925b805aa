"""Streams a path of 500 points, which the controller takes in lists of a few instructions, without a pause between them.

python stream_path.py [HOST:PORT]
"""

import numpy as np
from _address import addresses

import r6

turn = np.linspace(0.0, 2.0 * np.pi, 500)
path = np.zeros((500, 6))
path[:, 0] = 20.0 * np.sin(turn)
path[:, 1] = 10.0 * (1.0 - np.cos(turn))
path[:, 4] = 30.0

with addresses() as (address,), r6.Robot.connect(address) as robot:
    with robot.run(r6.Motion().axis_path(path, r6.Percent(50), blend=5)) as moving:
        for progress in moving:
            print(f"\r{progress.done} of {progress.total} points", end="", flush=True)
        done = moving.finished()
    error = np.abs(done.axes - path[-1]).max()
    print(f"\nat the end after {done.took:.1f} s, {error:.4f} deg from the last point")
