"""Registers 800 to 900 and the outputs: how this program and a taught one exchange values.

It switches Y013 on and off again and changes registers 810 to 812. First check what uses them in your
cell, because a program may start a motion by them. Read docs/SAFETY.md first.

python registers.py [HOST:PORT]
"""

import numpy as np
from _address import addresses

import r6

with addresses() as (address,), r6.Robot.connect(address) as robot:
    # Programs that share positions in registers usually store thousandths.
    place = np.array([500.25, -20.5, 300.0])
    robot.write_registers(810, np.rint(place * 1000).astype(np.int64))
    print("registers 810 to 812:", robot.read_registers(810, 3) / 1000, "mm")

    try:
        robot.write_registers(810, [2**40])
    except r6.R6Error as error:
        print("not taken:", error)

    # Points go by their names on the pendant.
    robot.set_output("Y013", True)
    print("Y013 is on:", robot.is_on("Y013"))
    robot.set_output("Y013", False)
