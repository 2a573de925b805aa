"""Reads the state of a robot: as a whole, by address, and repeatedly.

python read_state.py [HOST:PORT]
"""

from _address import addresses

import r6

with addresses() as (address,), r6.Robot.connect(address) as robot:
    status = robot.status()
    print(f"{status.machine_name}, firmware {status.firmware}, mode {status.mode}, alarm {status.alarm}")
    print("axes", status.axes.round(3), "deg")
    print("pose", status.pose.round(3), "mm, deg")
    for unmet in status.unmet:
        print("not ready:", unmet)
    if status.alarm:
        print(r6.alarm(status.alarm))

    values = robot.query("axis-0", "world-0", "curCycle", "input-0")
    for name, value in values.items():
        print(f"{name} = {value}")
    for name, why in values.missing.items():
        print(f"{name}: {why}")

    with robot.subscribe("axis-0", "axis-1", "curMode", every=0.05) as state:
        for _ in range(3):
            snapshot = state.next(timeout=5.0)
            if snapshot is not None:
                print(snapshot.array(), "not older than", snapshot.ages().max().round(3), "s")
    print("link", robot.link_quality().state)
