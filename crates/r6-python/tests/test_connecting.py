"""Searching for controllers, and controllers that connect to the program."""

import asyncio
import json
import socket

import pytest
from relay import Relay

import r6


def unused() -> str:
    """An address without a listener."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return f"127.0.0.1:{listener.getsockname()[1]}"


def test_who_is_there_is_told_in_the_order_of_the_addresses(virtual_controller: r6.Simulator) -> None:
    nobody = unused()
    addresses = [nobody, virtual_controller.address, "no address at all", virtual_controller.address]
    found = r6.discover(addresses, r6.RobotSettings(heartbeat=0.1))
    assert [one.address for one in found] == addresses
    here = virtual_controller.snapshot()
    for one in (found[1], found[3]):
        assert isinstance(one.who, r6.Identity)
        assert (one.who.firmware, one.who.machine_name) == (here.firmware, here.machine_name)
    assert isinstance(found[0].who, r6.NotSent) and found[0].who.reason == "unreachable"
    assert isinstance(found[2].who, r6.InvalidRequest) and found[2].who.reason == "bad_address"
    assert asyncio.run(r6.async_discover(addresses[1:2])) == found[1:2]
    assert r6.discover([]) == []
    with pytest.raises(TypeError):
        r6.discover(nobody)


def test_a_controller_that_dials_is_waited_for() -> None:
    listen = r6.Listen("127.0.0.1:0", only_from="127.0.0.1")
    assert listen.address.startswith("127.0.0.1:") and listen.address in repr(listen)
    with r6.Simulator(cameras=[listen.address]) as controller, r6.Robot.connect(listen) as robot:
        assert robot.status().is_ready and listen.address in robot.address
        robot.write_registers(800, [7])
        events = robot.pushed()
        controller.request_photo(1)
        assert events.next(timeout=60) == r6.Photo(1)
        with pytest.raises(RuntimeError, match="used"):
            r6.Robot.connect(listen)


def test_it_dials_through_asyncio_too() -> None:
    async def main() -> None:
        listen = r6.Listen("127.0.0.1:0")
        with r6.Simulator(cameras=[listen.address]):
            async with r6.AsyncRobot.connect(listen) as robot:
                assert (await robot.status()).is_ready

    asyncio.run(main())


def test_nobody_dials() -> None:
    """The wait ends, and the port is free for another attempt."""
    listen = r6.Listen("127.0.0.1:0")
    with pytest.raises(OSError):
        r6.Listen(listen.address)
    with pytest.raises(r6.NotSent) as failed:
        r6.Robot.connect(listen, r6.RobotSettings(connect_timeout=0.05))
    assert failed.value.reason == "connect_timed_out"
    assert r6.Listen(listen.address).address == listen.address


def test_others_are_not_taken_for_the_controller() -> None:
    listen = r6.Listen("127.0.0.1:0", only_from="192.0.2.1")
    with r6.Simulator(cameras=[listen.address]), pytest.raises(r6.NotSent):
        r6.Robot.connect(listen, r6.RobotSettings(connect_timeout=0.3))
    with pytest.raises(ValueError, match="no IP address"):
        r6.Listen("127.0.0.1:0", only_from="robot-3")
    with pytest.raises(OSError):
        r6.Listen("192.0.2.1:0")
    with pytest.raises(TypeError, match="Listen"):
        r6.Robot.connect(9760)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("settings", "type_key", "ds_id"),
    [
        (r6.RobotSettings(), "reqType", "www.hc-system.com.RemoteMonitor"),
        (r6.RobotSettings(type_key="cmdType", ds_id="short"), "cmdType", "HCRemoteMonitor"),
        (r6.RobotSettings(type_key="reqType", ds_id="long"), "reqType", "www.hc-system.com.RemoteMonitor"),
    ],
)
def test_older_spellings_can_be_chosen(
    settings: r6.RobotSettings, type_key: str, ds_id: str, virtual_controller: r6.Simulator, relay: Relay
) -> None:
    relay.target = virtual_controller.port
    with r6.Robot.connect(relay.address, settings) as robot:
        assert robot.query("curMode").integer("curMode") == 7
    frame = json.loads(bytes(relay.sent).split(b"}")[0] + b"}")
    assert frame[type_key] == "query" and frame["dsID"] == ds_id
    assert f"type_key='{type_key}'" in repr(settings)


def test_spellings_that_nobody_knows_are_refused() -> None:
    with pytest.raises(ValueError, match="`reqType`, `cmdType`"):
        r6.RobotSettings(type_key="type")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="`long`, `short`"):
        r6.RobotSettings(ds_id="HCRemoteMonitor")  # type: ignore[arg-type]
