"""Registers 800 to 900 and the outputs: what a taught program and this one tell each other.

It switches Y013 on and off again and leaves registers 810 to 812 changed: look first what hangs on them in your cell, for
a program may start a motion by them. Read docs/SAFETY.md first.

python registers.py [HOST:PORT]
"""

import numpy as np
from _address import addresses

import r6

with addresses() as (address,), r6.Robot.connect(address) as robot:
    # Positions go into registers as thousandths, by a habit of those who share cells with them.
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
