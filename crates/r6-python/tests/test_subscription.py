"""Values that come by themselves."""

import numpy as np
import pytest
from relay import Relay

import r6


def test_values_have_ages_and_a_quality(virtual_robot: r6.Robot) -> None:
    with virtual_robot.subscribe("axis-0", "curMode", "curMold", every=0.02) as state:
        for snapshot in state:
            if all(value.quality != "not_read" for value in snapshot.values):
                break
        assert [value.quality for value in snapshot.values] == ["fresh", "fresh", "unsupported"]
        assert snapshot["curMode"].reading == 7 and snapshot.fresh("curMold") is None
        assert snapshot.array().shape == (3,) and np.isnan(snapshot.array()[2])
        ages = snapshot.ages()
        assert ages.dtype == np.float64 and (ages[:2] >= 0).all() and (ages[:2] < 2).all()
        assert snapshot.failure is None
        with pytest.raises(KeyError):
            snapshot["axis-5"]
        latest = state.latest()
        assert latest["axis-0"].address == "axis-0"


def test_a_wait_has_a_limit(virtual_robot: r6.Robot) -> None:
    with virtual_robot.subscribe("curMode", every=3600) as state:
        while state.latest()["curMode"].quality == "not_read":
            state.next(timeout=10)
        with pytest.raises(TimeoutError):
            while True:
                state.next(timeout=0.05)


def test_it_ends_with_the_robot(virtual_robot: r6.Robot) -> None:
    state = virtual_robot.subscribe("curMode", every=0.02)
    virtual_robot.close()
    assert [snapshot for snapshot in state][-1:] is not None
    assert state.next() is None
    state.close()
    with pytest.raises(RuntimeError, match="closed"):
        state.latest()


def test_it_goes_on_after_a_lost_connection(relay: Relay, virtual_controller: r6.Simulator) -> None:
    relay.target = virtual_controller.port
    with r6.Robot.connect(relay.address) as robot, robot.subscribe("curMode", every=0.02) as state:
        lost = robot.pushed()
        while state.latest().fresh("curMode") != 7:
            state.next(timeout=10)
        relay.cut()
        event = lost.next(timeout=10)
        assert isinstance(event, r6.ConnectionLost)
        while not isinstance(event, r6.Reconnected):
            event = lost.next(timeout=10)
        while state.latest().fresh("curMode") != 7:
            state.next(timeout=10)


def test_what_cannot_be_subscribed_to_is_told(virtual_robot: r6.Robot) -> None:
    with pytest.raises(r6.NotSubscribed, match="no address"):
        virtual_robot.subscribe(every=1)
    with pytest.raises(r6.NotSubscribed, match="period"):
        virtual_robot.subscribe("curMode", every=0.001)
    with pytest.raises(r6.UnknownAddress):
        virtual_robot.subscribe("nothing", every=1)
