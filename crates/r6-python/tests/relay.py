"""A cable that can be pulled: a TCP relay."""

from __future__ import annotations

import socket
import threading


class Relay:
    """Carries bytes between whoever connects to it and the port that ``target`` names at that moment."""

    def __init__(self) -> None:
        self.target = 0
        self.sent = bytearray()
        """What came from those who connect to it, of all connections."""
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._sockets: list[socket.socket] = []
        self._lock = threading.Lock()
        threading.Thread(target=self._accept, daemon=True).start()

    @property
    def address(self) -> str:
        """Where it listens."""
        return f"127.0.0.1:{self._listener.getsockname()[1]}"

    def cut(self) -> None:
        """Ends all connections; new ones are carried again."""
        with self._lock:
            sockets, self._sockets = self._sockets, []
        for end in sockets:
            shut(end)

    def close(self) -> None:
        """Ends it."""
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
            for source, sink, kept in ((near, far, self.sent), (far, near, bytearray())):
                threading.Thread(target=carry, args=(source, sink, kept), daemon=True).start()


def carry(source: socket.socket, sink: socket.socket, kept: bytearray) -> None:
    """One direction, until either end is gone; keeps what it carries."""
    with source:
        try:
            while data := source.recv(4096):
                kept += data
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
