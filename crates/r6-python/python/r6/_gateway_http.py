"""HTTP with a gateway: one request a connection, and what an answer means. Only what the gateway knows by its
``Idempotency-Key`` is asked again."""

from __future__ import annotations

import http.client
import ipaddress
import json
import socket
import ssl
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from time import monotonic, sleep
from typing import Any, Literal, TypeVar
from urllib.parse import urlencode, urlsplit

from ._errors import InvalidRequest, NotSent, OutcomeUnknown, Refused, RequestError

DEFAULT_PORT = 9780

_MOST_BYTES = 8 * 1024 * 1024
"""The longest answer: twice a page of 1000 audit entries of 4 KiB. A longer one is not from a gateway."""

_MOST_LINE_BYTES = 1024 * 1024
"""The longest line of a stream. A robot has some 220 values at most, each of some hundred bytes."""

_SILENCE = 40.0
"""Seconds without a byte after which a stream counts as lost. The gateway sends something every 15 s."""

_AGAIN = frozenset(
    {
        "leased",
        "run_under_way",
        "in_progress",
        "not_ready",
        "too_many_requests",
        "overloaded",
        "store_unavailable",
        "no_owner",
        "unreachable",
        "no_reply",
    }
)
"""Reasons of what was not sent that can pass by themselves."""

_WAITS = (0.25, 2.0)
"""Seconds before a request is asked again: the first wait, doubled each time, and the longest one. A gateway
starts again within seconds."""

UNREADABLE = (KeyError, TypeError, ValueError, AttributeError, OverflowError)
"""What reading an answer raises if it has another shape than a gateway's."""

Effect = Literal["reads", "changes", "moves", "stops"]

T = TypeVar("T")


class HttpClient:
    """Sends requests to one gateway. It holds no connection, so it can be used from several threads."""

    def __init__(
        self,
        url: str,
        *,
        token: str | None,
        token_file: str | Path | None,
        ca_file: str | Path | None,
        insecure_http: bool,
        timeout: float,
    ) -> None:
        """As ``Gateway``."""
        parts = urlsplit(url)
        wrong = parts.username or parts.password or parts.path not in ("", "/") or parts.query or parts.fragment
        if parts.scheme not in ("http", "https") or not parts.hostname or wrong:
            raise ValueError(f"{url!r} is not the URL of a gateway, such as http://127.0.0.1:9780")
        if (token is None) == (token_file is None):
            raise ValueError("give either token or token_file; `r6 gateway token` makes a token")
        if token_file is not None:
            token = Path(token_file).read_text(encoding="utf-8")
        self._token = _plain_token(token or "")
        self._host = parts.hostname
        self._port = parts.port or DEFAULT_PORT
        self._timeout = timeout
        self._tls: ssl.SSLContext | None = None
        if parts.scheme == "https":
            self._tls = ssl.create_default_context(cafile=None if ca_file is None else str(ca_file))
        elif not (insecure_http or _is_this_machine(self._host)):
            raise ValueError(
                f"{url}: everyone on the network could read the token: use https, or insecure_http=True"
            )

    def __repr__(self) -> str:
        scheme = "http" if self._tls is None else "https"
        return f"Gateway({scheme}://{self._host}:{self._port})"

    def _connect(self, timeout: float) -> http.client.HTTPConnection:
        """Makes a connection. Nothing is sent over it yet."""
        connection: http.client.HTTPConnection
        if self._tls is None:
            connection = http.client.HTTPConnection(self._host, self._port, timeout=timeout)
        else:
            connection = http.client.HTTPSConnection(self._host, self._port, timeout=timeout, context=self._tls)
        try:
            connection.connect()
        except ssl.SSLCertVerificationError as error:
            advice = "the certificate.pem of the gateway, or that of who issued it, goes into ca_file"
            raise not_sent("unreachable", f"{self!r} is not trusted: {error}: {advice}") from error
        except OSError as error:
            raise not_sent("unreachable", f"{self!r} cannot be reached: {error}") from error
        return connection

    def _send(
        self,
        connection: http.client.HTTPConnection,
        method: str,
        path: str,
        body: str | None = None,
        headers: Mapping[str, str] | None = None,
    ) -> http.client.HTTPResponse:
        """Sends a request once."""
        named = {"Authorization": f"Bearer {self._token}", "Connection": "close", **(headers or {})}
        if body is not None:
            named["Content-Type"] = "application/json"
        connection.request(method, path, body=body, headers=named)
        return connection.getresponse()

    def _lost(self, method: str, path: str, effect: Effect, error: Exception) -> OutcomeUnknown:
        reason = "timed_out" if isinstance(error, TimeoutError) else "connection_lost"
        problem = OutcomeUnknown(f"{self!r} gave no answer to {method} {path.split('?')[0]}: {error}")
        problem.reason, problem.effect, problem.may_send_again = reason, effect, effect in ("reads", "stops")
        return problem

    def unclear(self, method: str, path: str, effect: Effect, what: str) -> OutcomeUnknown:
        """Something answered, and not as a gateway does."""
        problem = OutcomeUnknown(f"{self!r} answered {method} {path.split('?')[0]} with {what}")
        problem.reason, problem.effect, problem.may_send_again = "unclear", effect, effect in ("reads", "stops")
        return problem

    def ask(
        self,
        method: str,
        path: str,
        read: Callable[[Any], T],
        body: Mapping[str, Any] | None = None,
        effect: Effect = "reads",
        headers: Mapping[str, str] | None = None,
        timeout: float | None = None,
    ) -> T:
        """Sends a request, and reads the JSON of its answer: ``None`` for an answer without any. ``timeout``: in
        place of that of the client."""
        data = None if body is None else json.dumps(body, allow_nan=False)
        timeout = self._timeout if timeout is None else timeout
        connection, end = self._connect(timeout), monotonic() + timeout
        # The time-out of a socket begins anew with each byte.
        cut = threading.Timer(timeout, _cut, (connection.sock,))
        cut.daemon = True
        cut.start()
        try:
            with self._send(connection, method, path, data, headers) as response:
                text = response.read(_MOST_BYTES + 1)
                if response.length and len(text) <= _MOST_BYTES:
                    raise EOFError("the answer breaks off")
        except (OSError, EOFError, http.client.HTTPException) as error:
            late = TimeoutError(f"not within {timeout:g} s") if monotonic() >= end else error
            raise self._lost(method, path, effect, late) from error
        finally:
            cut.cancel()
            connection.close()
        answer = None if response.status == 204 else _json(text)
        if response.status // 100 != 2:
            raise self._problem(response.status, answer, method, path, effect)
        try:
            return read(answer)
        except UNREADABLE as error:
            what = f"status {response.status}, and something that cannot be read"
            raise self.unclear(method, path, effect, what) from error

    def ask_once(self, path: str, read: Callable[[Any], T], body: Mapping[str, Any], effect: Effect, key: str) -> T:
        """Posts a request that the gateway carries out once. While no answer comes, it is asked again with the
        same key, within the time-out of the first one.

        After a lost answer, "not sent" is no proof: the first request may still be on its way. It counts as unknown.
        """
        headers, end = {"Idempotency-Key": header(key, "Idempotency-Key")}, monotonic() + self._timeout
        lost: OutcomeUnknown | None = None
        wait = _WAITS[0]
        while True:
            left = max(0.001, end - monotonic())
            try:
                return self.ask("POST", path, read, body, effect, headers, left)
            except OutcomeUnknown as unknown:
                if unknown.reason not in ("timed_out", "connection_lost"):
                    raise
                lost = lost or unknown
            except (NotSent, InvalidRequest) as refused:
                if lost is None:
                    raise
                if refused.reason not in ("in_progress", "unreachable", "overloaded", "no_owner"):
                    raise lost from refused
            if monotonic() + wait >= end:
                raise lost
            sleep(wait)
            wait = min(2 * wait, _WAITS[1])

    def _problem(self, status: int, answer: Any, method: str, path: str, effect: Effect) -> RequestError:
        """The error that a problem stands for. What is not a gateway's answer proves nothing."""
        is_problem = isinstance(answer, dict) and isinstance(answer.get("code"), str)
        if not is_problem or status < 400:
            return self.unclear(method, path, effect, f"status {status}, and not as a gateway does")
        code, text = answer["code"], str(answer.get("message", answer["code"]))
        # A stop with `store_unavailable` was carried out: only the database did not confirm that it holds.
        is_done = effect == "stops" and code == "store_unavailable"
        if is_done or code in ("outcome_unknown", "not_stopped"):
            unknown = OutcomeUnknown(text)
            unknown.reason, unknown.effect, unknown.may_send_again = code, effect, effect == "stops"
            return unknown
        if code == "refused":
            refused = Refused(text)
            refused.reason = code
            return refused
        if status in (400, 404, 405, 413, 415, 422, 428):
            invalid = InvalidRequest(text)
            invalid.reason = code
            return invalid
        if status in (401, 403, 408, 409, 412, 429, 503):
            return not_sent(code, text)
        other = OutcomeUnknown(text)
        other.reason, other.effect = code, effect
        return other

    def stream(
        self, path: str, asked: Mapping[str, str | None], after: str | None
    ) -> Iterator[tuple[str, str, dict[str, Any]]]:
        """The messages of a stream of server-sent events: id, kind, data."""
        wanted = urlencode({name: value for name, value in asked.items() if value is not None})
        path = f"{path}?{wanted}" if wanted else path
        headers = {} if after is None else {"Last-Event-ID": header(after)}
        connection = self._connect(_SILENCE)
        try:
            try:
                response = self._send(connection, "GET", path, headers=headers)
            except (OSError, http.client.HTTPException) as error:
                raise self._lost("GET", path, "reads", error) from error
            with response:
                if response.status != 200:
                    answer = _json(response.read(_MOST_BYTES))
                    raise self._problem(response.status, answer, "GET", path, "reads")
                yield from self._messages(response, path)
        finally:
            connection.close()

    def _messages(self, response: http.client.HTTPResponse, path: str) -> Iterator[tuple[str, str, dict[str, Any]]]:
        number, kind, data = "", "message", ""
        while True:
            try:
                line = response.readline(_MOST_LINE_BYTES)
            except (OSError, http.client.HTTPException, ValueError) as error:
                raise self._lost("GET", path, "reads", error) from error
            if not line.endswith(b"\n"):
                cause = "the line is too long" if line else "the stream has ended"
                raise self._lost("GET", path, "reads", EOFError(cause))
            name, _, value = line.decode("utf-8", "replace").rstrip("\r\n").partition(":")
            value = value.removeprefix(" ")
            if name == "event":
                kind = value
            elif name == "id":
                number = value
            elif name == "data":
                data += value
                if len(data) > _MOST_BYTES:
                    raise self._lost("GET", path, "reads", EOFError("the message is too long"))
            elif not name and not value and data:
                read = _json(data.encode())
                if not isinstance(read, dict):
                    raise self._lost("GET", path, "reads", EOFError("a message is no JSON object"))
                yield number, kind, read
                number, kind, data = "", "message", ""


def _plain_token(text: str) -> str:
    """The token, also from a file with the header for curl."""
    token = text.strip()
    header = "authorization: bearer "
    if token.lower().startswith(header):
        token = token[len(header) :].strip()
    if not token or not all("!" <= letter <= "~" for letter in token):
        raise ValueError("this is no token: `r6 gateway token` prints one, a line without blanks")
    return token


def header(text: str, what: str = "id of an event") -> str:
    if not all("!" <= letter <= "~" for letter in text):
        raise ValueError(f"{text!r} is no {what}")
    return text


def _is_this_machine(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _cut(stream: socket.socket) -> None:
    """Ends a connection, also while another thread reads from it."""
    with suppress(OSError):
        socket.socket.shutdown(stream, socket.SHUT_RDWR)


def _json(text: bytes) -> Any:
    """The value of a JSON text; ``None`` if the text is not JSON."""
    if len(text) > _MOST_BYTES:
        return None
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return None


def not_sent(code: str, text: str) -> NotSent:
    problem = NotSent(text)
    problem.reason, problem.may_send_again = code, code in _AGAIN
    return problem
