"""A page and its news, served on this machine's loopback address only."""

from __future__ import annotations

import json
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from queue import Empty, Full, Queue
from typing import Any

from ...exceptions import ParameterError

_HEARTBEAT = 5.0  # s, after which a browser that has left is noticed
_NAMES = {"127.0.0.1", "localhost"}


class Server:
    """Serves one page, and sends updates to every browser that shows it; never waits for a browser.

    Args:
        page: Returns the page, given the number of the latest news that it knows of; the page asks for
            `events?NUMBER`, and is answered at once if there has been any since.
        port: Port on 127.0.0.1; 0 for any that is free.

    Raises:
        ParameterError: The port is not free, or is none.
    """

    def __init__(self, page: Callable[[int], str], port: int = 0) -> None:
        self._page = page
        self._count, self._latest = 1, ""
        self._listeners: set[Queue[str | None]] = set()
        self._lock = threading.Lock()
        try:
            self._http = _Http(port, self)
        except (OSError, OverflowError) as error:
            words = f"free on this machine, or 0 for any ({error})"
            raise ParameterError("port", port, words) from error
        threading.Thread(target=self._http.serve_forever, args=(0.05,), daemon=True).start()

    @property
    def url(self) -> str:
        """Address of the page."""
        return f"http://127.0.0.1:{self._http.server_address[1]}/"

    def tell(self, news: Mapping[str, Any]) -> None:
        """Send news to every browser that shows the page; one that lags behind gets the latest only."""
        message = json.dumps(news)
        with self._lock:
            self._count, self._latest = self._count + 1, message
            for queue in self._listeners:
                _put_latest(queue, message)

    def close(self) -> None:
        """Stop, and free the port."""
        with self._lock:
            for queue in self._listeners:
                _put_latest(queue, None)
        self._http.shutdown()
        self._http.server_close()

    def page(self) -> bytes:
        """The page as it is now."""
        return self._page(self._count).encode()

    @contextmanager
    def news(self, known: str) -> Iterator[Queue[str | None]]:
        """A queue that gets all news since the number that is known, as long as the context lasts."""
        queue: Queue[str | None] = Queue(maxsize=1)
        with self._lock:
            self._listeners.add(queue)
            if known != str(self._count) and self._latest:
                queue.put_nowait(self._latest)
        try:
            yield queue
        finally:
            with self._lock:
                self._listeners.discard(queue)


class _Http(ThreadingHTTPServer):
    daemon_threads = True
    block_on_close = False

    def __init__(self, port: int, owner: Server) -> None:
        super().__init__(("127.0.0.1", port), _Handler)
        self.owner = owner

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A browser that leaves is no error; everything else is one."""
        if not isinstance(sys.exc_info()[1], OSError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    server: _Http

    def do_GET(self) -> None:
        host = self.headers.get("Host", "").rpartition(":")[0]
        if host not in _NAMES:  # another site's page, by a name that it made mean this machine
            self.send_error(403)
        elif self.path == "/":
            self._send_page(self.server.owner.page())
        elif self.path.startswith("/events?"):
            self._send_news(self.path.removeprefix("/events?"))
        else:
            self.send_error(404)

    def log_message(self, *args: object) -> None:
        del args

    def _begin(self, kind: str, headers: Mapping[str, str] | None = None) -> None:
        self.send_response(200)
        fields = {"Content-Type": kind, "Cache-Control": "no-store", **(headers or {})}
        for name, value in fields.items():
            self.send_header(name, value)
        self.end_headers()

    def _send_page(self, content: bytes) -> None:
        self._begin("text/html; charset=utf-8", {"Content-Length": str(len(content))})
        self.wfile.write(content)

    def _send_news(self, known: str) -> None:
        # The queue comes before the answer: whoever has that misses nothing.
        with self.server.owner.news(known) as queue:
            self._begin("text/event-stream")
            while (message := _next(queue)) is not None:
                self.wfile.write(message.encode())
                self.wfile.flush()


def _next(queue: Queue[str | None]) -> str | None:
    """The next event as text; a comment where there is none for a while; None at the end."""
    try:
        message = queue.get(timeout=_HEARTBEAT)
    except Empty:
        return ": still here\n\n"
    return None if message is None else f"data: {message}\n\n"


def _put_latest(queue: Queue[str | None], message: str | None) -> None:
    """Put a message into a queue for one, in place of the one that is there."""
    while True:
        try:
            queue.put_nowait(message)
            return
        except Full:
            try:
                queue.get_nowait()
            except Empty:
                continue
