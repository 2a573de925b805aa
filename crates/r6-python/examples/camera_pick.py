"""A camera on the robot's own connection: waits for a photo request, answers it, sends what the photo shows,
and checks that the part was picked.

A taught program on the controller asks for the photo, takes the point and goes there. Without an address
this example starts a virtual controller with such a program.

python camera_pick.py [HOST:PORT]
"""

import sys

import r6

PROGRAM = """
[[step]]
do = "axis-move"
to = [0, 0, 0, 0, 30, 0]
speed = 50
[[step]]
do = "photo"
camera = 1
limit = 5
tries = 100
[[step]]
do = "take-point"
camera = 1
[[step]]
do = "move-to-point"
speed = 20
[[step]]
do = "output"
point = "Y010"
on = true
[[step]]
do = "wait"
point = "X047"
"""

PART = r6.Point(x=20.0, y=10.0, z=-30.0, relative=True)
"""The content of the photo: a part at this distance from the tool, mm. In a cell it comes from your
camera."""


def photo(events: r6.PushedEvents) -> r6.Photo:
    """The next photo request."""
    for event in events:
        match event:
            case r6.Photo():
                return event
            case r6.ConnectionLost():
                raise RuntimeError(event.text)
    raise RuntimeError("the robot was closed")


def serve(address: str) -> None:
    """Serves one pick."""
    with r6.Robot.connect(address) as robot:
        print("waiting for a program that asks for a photo", flush=True)
        asked = photo(robot.pushed())
        robot.answer_photo(asked)
        accepted = robot.add_points(asked.cam_id, [PART])
        print(f"camera {asked.cam_id}: {accepted.points} point taken")
        with robot.subscribe("output-0", "curAlarm", every=0.1) as state:
            for snapshot in state:
                if alarm := snapshot.fresh("curAlarm"):
                    raise RuntimeError(f"alarm {alarm}")
                outputs = snapshot.fresh("output-0")
                if isinstance(outputs, int) and outputs & 1:
                    break
        print("picked at", robot.status().pose.round(3))


if len(sys.argv) > 1:
    serve(sys.argv[1])
else:
    with r6.Simulator(program=PROGRAM, clock=10) as controller:
        serve(controller.address)
