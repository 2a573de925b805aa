"""A cable that can be disconnected: a TCP relay."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable


class Relay:
    """Carries bytes between its clients and the port that ``target`` names at that moment."""

    def __init__(self) -> None:
        self.target = 0
        self.sent = bytearray()
        """The bytes from all clients, of all connections."""
        self.answers = threading.Event()
        """While it is cleared, replies are held back on all connections."""
        self.answers.set()
        self.connections = 0
        """All connections that were ever made to it."""
        self.before_reply: Callable[[], None] | None = None
        """Called before each reply is passed on, in a thread of the relay."""
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._sockets: list[socket.socket] = []
        self._lock = threading.Lock()
        threading.Thread(target=self._accept, daemon=True).start()

    @property
    def address(self) -> str:
        """Where it listens."""
        return f"127.0.0.1:{self._listener.getsockname()[1]}"

    def cut(self) -> None:
        """Ends all connections; new ones work again."""
        with self._lock:
            sockets, self._sockets = self._sockets, []
        for end in sockets:
            shut(end)

    def close(self) -> None:
        """Ends the relay."""
        self.answers.set()
        shut(self._listener)
        self._listener.close()
        self.cut()

    def _accept(self) -> None:
        while True:
            try:
                near, _ = self._listener.accept()
            except OSError:
                return
            far = socket.create_connection(("127.0.0.1", self.target))
            with self._lock:
                self._sockets += [near, far]
                self.connections += 1
            for source, sink, seen in ((near, far, self._request), (far, near, self._reply)):
                threading.Thread(target=carry, args=(source, sink, seen), daemon=True).start()

    def _request(self, data: bytes) -> None:
        self.sent += data

    def _reply(self, data: bytes) -> None:
        self.answers.wait()
        if self.before_reply is not None:
            self.before_reply()


def carry(source: socket.socket, sink: socket.socket, seen: Callable[[bytes], None]) -> None:
    """Carries one direction until either end is gone. Calls ``seen`` with the bytes before it passes them
    on."""
    with source:
        try:
            while data := source.recv(4096):
                seen(data)
                sink.sendall(data)
        except OSError:
            pass
        shut(sink)


def shut(end: socket.socket) -> None:
    """Ends a connection; it may have ended already."""
    try:
        end.shutdown(socket.SHUT_RDWR)
    except OSError:
        pass
