"""Moves a robot: axes, a straight line, an output, behind a guard. Ctrl-C stops the arm.

The arm moves: to J5 = 30 degrees and all others at zero, at 10 %, then 50 mm down and up again. It
switches Y010 on and off. Read docs/SAFETY.md first. The guard checks targets as they are written: axes in
axis moves, places in straight lines. It does not know where the axes are on a line.

python move.py [HOST:PORT]
"""

from _address import addresses

import r6

SLOW = r6.Percent(10)
ENVELOPE = (
    r6.Envelope()
    .speed_cap(r6.Percent(20))
    .axis_limits(0, r6.Degrees(-90), r6.Degrees(90))
    .largest_axis_step(r6.Degrees(60))
)

with addresses() as (address,), r6.Robot.connect(address) as unguarded:
    robot = unguarded.with_guard(ENVELOPE)
    to_start = r6.Motion().axis_move(r6.AxisPosition.degrees([0, 0, 0, 0, 30, 0]), SLOW)
    with robot.run(to_start) as moving:
        there = moving.finished()

    # On the line the tool may only go straight down from here.
    x, y, z, u, v, w = there.pose
    mm = r6.Millimetres
    robot = robot.with_guard(ENVELOPE.workspace((mm(x - 1), mm(y - 1), mm(z - 60)), (mm(x + 1), mm(y + 1), mm(z + 1))))
    below = r6.Pose.mm_deg([x, y, z - 50, u, v, w])
    above = r6.Pose.mm_deg([x, y, z, u, v, w])
    pick = (
        r6.Motion()
        .linear_move(below, SLOW)
        .set_output("Y010", True)
        .wait(0.2)
        .linear_move(above, SLOW)
        .set_output("Y010", False)
    )
    print("it would send", *robot.dry_run(pick), sep="\n  ")
    with robot.run(pick) as moving:
        for progress in moving:
            print(progress)
        done = moving.finished()
    print("pose", done.pose.round(3), f"after {done.took:.2f} s")
