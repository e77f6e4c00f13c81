"""The guide as a page in a browser: a server on 127.0.0.1 with a single-use token."""

import json
import math
import secrets
import threading
from http.cookies import SimpleCookie
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from typing import Any
from urllib.parse import parse_qs, urlsplit

from trihedron.records.guiding import GuideView

COOKIE = "trihedron_guide"
KEEP_ALIVE_S = 5.0


def view_as_json(view: GuideView, lost: int = 0) -> str:
    """The content of the page as strict JSON; non-finite numbers are ``null``."""
    known = view.examination

    def vector(values: Any) -> list[float] | None:
        return None if values is None else [round(float(v), 4) for v in values]

    angle = view.degrees_to_target
    state = {
        "phase": view.phase.value,
        "instruction": view.instruction,
        "detail": view.detail,
        "still": view.is_still,
        "held": round(view.held_s, 2),
        "pose": round(view.pose_s, 2),
        "poses": view.n_poses,
        "checks": view.n_checks,
        "events": view.n_events,
        "up": vector(view.up_now),
        "target": vector(view.target_up),
        "angle": None if angle is None else round(angle),
        "taken": [] if known is None else [vector(up) for up in known.poses_up],
        "warnings": list(view.warnings[:3]),
        "wanted": view.accuracy.sentence(),
        "rate": None if known is None else round(known.rate_hz, 2),
        "needed": None if known is None else known.poses_needed,
        "shortfall": None if known is None or not math.isfinite(known.shortfall) else round(known.shortfall, 3),
        "good": known is not None and known.is_good_enough,
        "lost": lost,
        "time": round(view.time_s, 1),
        "bars": []
        if known is None
        else [
            {"sensor": one.sensor, "name": one.name, "now": one.now, "next": one.after_next, "wanted": one.wanted}
            for one in known.uncertain
        ],
    }
    return json.dumps(state, allow_nan=False)


class _QuietServer(ThreadingHTTPServer):
    daemon_threads = True

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Print nothing: a page closed during a response is no error."""


def _begin(request: BaseHTTPRequestHandler, status: int, headers: dict[str, str]) -> None:
    request.send_response(status)
    for name, value in headers.items():
        request.send_header(name, value)
    request.end_headers()


class Page:
    """Serves the page until closed; ``address`` includes a token that is valid once.

    The token is exchanged for a cookie at the first visit and then invalid, so that a link seen over a shoulder, in a
    list of processes or in a history opens nothing. Requests for another host name are rejected: this prevents DNS
    rebinding by a page of the internet.
    """

    def __init__(self, port: int = 0) -> None:
        self._token: str | None = secrets.token_urlsafe(24)
        self._session = secrets.token_urlsafe(24)
        self._latest = "{}"
        self._version = 0
        self._changed = threading.Condition()
        self._is_closed = False
        page = self

        class Handler(BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def do_GET(self) -> None:
                page._answer(self)

            def log_message(self, *_args: object) -> None:
                """Print nothing: the terminal shows the guide."""

        self._server = _QuietServer(("127.0.0.1", port), Handler)
        self._host = f"127.0.0.1:{self._server.server_address[1]}"
        self.address = f"http://{self._host}/?token={self._token}"
        threading.Thread(target=self._server.serve_forever, name="guide page", daemon=True).start()

    def show(self, view: GuideView, lost: int = 0) -> None:
        """Send the view to every open page."""
        text = view_as_json(view, lost)
        with self._changed:
            self._latest = text
            self._version += 1
            self._changed.notify_all()

    def close(self) -> None:
        """End the streams of open pages and stop the server."""
        with self._changed:
            self._is_closed = True
            self._changed.notify_all()
        self._server.shutdown()
        self._server.server_close()

    def _answer(self, request: BaseHTTPRequestHandler) -> None:
        asked = urlsplit(request.path)
        if request.headers.get("Host") != self._host:
            self._reject(request, "This page answers to its own address only.")
            return
        cookie = SimpleCookie(request.headers.get("Cookie", "")).get(COOKIE)
        is_known = cookie is not None and secrets.compare_digest(cookie.value, self._session)
        if asked.path == "/" and not is_known:
            given = parse_qs(asked.query).get("token", [""])[0]
            with self._changed:
                is_known = self._token is not None and secrets.compare_digest(given, self._token)
                if is_known:
                    self._token = None
        if not is_known:
            self._reject(request, "The link was used already, or is not the one that trihedron printed.")
        elif asked.path == "/":
            self._send_page(request)
        elif asked.path == "/events":
            self._stream(request)
        else:
            self._reject(request, "There is nothing here.", 404)

    def _reject(self, request: BaseHTTPRequestHandler, sentence: str, status: int = 403) -> None:
        body = (sentence + "\n").encode()
        _begin(request, status, {"Content-Type": "text/plain; charset=utf-8", "Content-Length": str(len(body))})
        request.wfile.write(body)

    def _send_page(self, request: BaseHTTPRequestHandler) -> None:
        nonce = secrets.token_urlsafe(16)
        text = files("trihedron.cli").joinpath("page.html").read_text("utf-8").replace("{{nonce}}", nonce)
        body = text.replace("{{body}}", files("trihedron.report").joinpath("body.js").read_text("utf-8")).encode()
        policy = f"default-src 'none'; script-src 'nonce-{nonce}'; style-src 'nonce-{nonce}'; connect-src 'self'"
        cookie = f"{COOKIE}={self._session}; HttpOnly; SameSite=Strict; Path=/"
        headers = {"Content-Type": "text/html; charset=utf-8", "Content-Length": str(len(body)), "Set-Cookie": cookie}
        headers |= {"Content-Security-Policy": policy, "Referrer-Policy": "no-referrer", "Cache-Control": "no-store"}
        _begin(request, 200, headers)
        request.wfile.write(body)

    def _stream(self, request: BaseHTTPRequestHandler) -> None:
        kind = "text/event-stream"
        _begin(request, 200, {"Content-Type": kind, "Cache-Control": "no-store", "Connection": "close"})
        request.close_connection = True
        seen = 0
        try:
            while True:
                with self._changed:
                    if self._version == seen and not self._is_closed:
                        self._changed.wait(KEEP_ALIVE_S)
                    text = self._latest if self._version != seen else ""
                    seen, is_closed = self._version, self._is_closed
                request.wfile.write(f"data: {text}\n\n".encode() if text else b": still here\n\n")
                request.wfile.flush()
                if is_closed:
                    request.wfile.write(b"event: end\ndata: {}\n\n")
                    request.wfile.flush()
                    return
        except OSError:
            # The page was closed.
            return
