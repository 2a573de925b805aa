"""The camera's side of the connection."""

import pytest

import r6


def test_a_photo_is_asked_for_answered_and_its_points_sent(
    virtual_robot: r6.Robot, virtual_controller: r6.Simulator
) -> None:
    events = virtual_robot.pushed()
    assert virtual_robot.status().is_ready, "the controller knows of the connection"
    virtual_controller.request_photo(2)
    photo = events.next(timeout=10)
    assert photo == r6.Photo(cam_id=2)
    virtual_robot.answer_photo(r6.Photo(2))
    points = [r6.Point(x=1.5, y=2.5, z=3, angle=90, u=180, v=0, model_id=1, similarity=0.9, color=2), r6.Point(1, 2)]
    assert virtual_robot.add_points(2, points).points == 2
    assert virtual_robot.link_quality().strays == 0


def test_a_point_has_to_be_one(virtual_robot: r6.Robot) -> None:
    with pytest.raises(TypeError, match="r6.Point"):
        virtual_robot.add_points(0, [(1, 2)])  # type: ignore[list-item]
    with pytest.raises(TypeError):
        virtual_robot.add_points(0, [r6.Point(x="far", y=0)])  # type: ignore[arg-type]


def test_events_end_with_the_robot(virtual_robot: r6.Robot) -> None:
    events = virtual_robot.pushed()
    virtual_robot.close()
    assert [type(event) for event in events] in ([], [r6.ConnectionLost])
