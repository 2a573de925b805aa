"""What the tests share besides the fixtures of the package."""

from collections.abc import Iterator

import pytest
from relay import Relay


@pytest.fixture
def relay() -> Iterator[Relay]:
    """A cable that can be pulled."""
    relay = Relay()
    yield relay
    relay.close()
