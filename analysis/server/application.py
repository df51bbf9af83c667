"""The server of the studio: on the loopback address alone, for one page that has its token."""

from __future__ import annotations

import base64
import hashlib
import json
import os
import re
import secrets
import socket
from collections.abc import Callable, Iterable, Mapping
from http import HTTPStatus
from typing import Any, get_args
from urllib.parse import parse_qs

from linkwork.errors import InputError

from ..files import unknown_name
from ..libraries import MissingLibraryError
from ..synthesis import Kind
from .worker import Busy, Worker

try:
    from waitress import wasyncore
    from waitress.server import create_server
except ImportError as error:
    raise MissingLibraryError("waitress") from error

#: The only address that is listened at; bytes of a request's body and of its head, at most; connections at a time, below the
#: 512 that Windows can wait for.
ADDRESS, BODY, HEAD, CONNECTIONS = "127.0.0.1", 512_000, 16_000, 400
#: Seconds of silence after which a connection is closed, and where more than half of all are open.
SILENCE, SHORT_SILENCE = 30.0, 2.0
#: Where the page sends its token.
TOKEN = "X-Linkwork-Token"
#: Kinds of jobs: the names of `jobs.JOBS`, whose import takes a second.
JOB_KINDS = ("linkages", "slider", "tune", "run", "export")
_LOST = "the token is missing or wrong: open the address that linkwork studio printed"
#: Served in the place of the page where the address has no token: the page moves it from there to the browser's storage.
_LOST_PAGE = f"""<!doctype html><html lang="en"><meta charset="utf-8"><title>linkwork studio</title><p>{_LOST}</p><script>
const token = localStorage.getItem("linkwork-token");
if (token && !location.search) location.replace(`/?token=${{encodeURIComponent(token)}}${{location.hash}}`);
</script></html>"""
#: How the page knows that there is a server, and what kinds of linkages it searches.
_MARK = f'<meta name="linkwork-server" content="{" ".join(get_args(Kind))}">'

_HEADERS = [
    ("Cache-Control", "no-store"),
    ("Cross-Origin-Opener-Policy", "same-origin"),
    ("Cross-Origin-Resource-Policy", "same-origin"),
    ("Referrer-Policy", "no-referrer"),
    ("X-Content-Type-Options", "nosniff"),
    ("X-Frame-Options", "DENY"),
]
#: What a page may load: itself. Its scripts are named by their hashes, beside these.
_POLICY = (
    "default-src 'none'; script-src 'wasm-unsafe-eval' {}; worker-src blob:; style-src 'unsafe-inline'; "
    "img-src data: blob:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)

_Start = Callable[[str, list[tuple[str, str]]], Any]


class _Refused(Exception):
    """A request that is not served, with the status and the sentence that say why."""

    def __init__(self, status: HTTPStatus, sentence: str) -> None:
        self.status, self.sentence = status, sentence
        super().__init__(sentence)


class Application:
    """Serves a page and takes its jobs (WSGI).

    Every request must name this machine as its host, which a page that reached it by a name of its own does not; come from no
    other page; and bring the token, in the address of the page and in a header of its requests. There are two places, the page
    and its job: what a request names is looked up in that table, and never on a disk.

    Parameters
    ----------
    page : str
        With the state that it opens with.
    worker : Worker
        Does the jobs.
    """

    def __init__(self, page: str, worker: Worker) -> None:
        self.worker = worker
        self.token = secrets.token_urlsafe(32)
        #: Hosts that are this server, known once it listens.
        self.hosts: tuple[str, ...] = ()
        self.page = page.replace("<title>", f"{_MARK}\n<title>", 1).encode()
        self._lost = _LOST_PAGE.encode()
        self._policy = _POLICY.format(_hashes(page + _LOST_PAGE))
        self._places: dict[str, dict[str, Callable[[Mapping[str, Any]], tuple[HTTPStatus, bytes]]]] = {
            "/": {"GET": self._page},
            "/job": {"GET": self._look, "POST": self._give, "DELETE": self._cancel},
        }

    def __call__(self, environ: Mapping[str, Any], start: _Start) -> Iterable[bytes]:
        headers = list(_HEADERS)
        try:
            status, body = self._served(environ)
        except _Refused as refused:
            status, body = refused.status, _json({"sentence": refused.sentence})
        page = body is self.page or body is self._lost
        headers.append(("Content-Type", "text/html; charset=utf-8" if page else "application/json"))
        headers.append(("Content-Security-Policy", self._policy if page else "default-src 'none'"))
        headers.append(("Content-Length", str(len(body))))
        start(f"{status.value} {status.phrase}", headers)
        return [body]

    def _served(self, environ: Mapping[str, Any]) -> tuple[HTTPStatus, bytes]:
        if environ.get("HTTP_HOST") not in self.hosts:
            raise _Refused(
                HTTPStatus.MISDIRECTED_REQUEST,
                "this server answers at its own address alone: open the one that linkwork studio printed; a tunnel must "
                "keep its port",
            )
        place = environ.get("PATH_INFO", "")
        origin = environ.get("HTTP_ORIGIN")
        site = environ.get("HTTP_SEC_FETCH_SITE", "none")
        if (origin is not None and origin not in {f"http://{host}" for host in self.hosts}) or (
            place != "/" and site not in ("same-origin", "none")
        ):
            raise _Refused(HTTPStatus.FORBIDDEN, "a page of another origin is not served")
        if place not in self._places:
            raise _Refused(HTTPStatus.NOT_FOUND, "there is nothing here")
        served = self._places[place].get(environ["REQUEST_METHOD"])
        if served is None:
            raise _Refused(HTTPStatus.METHOD_NOT_ALLOWED, f"this place takes {', '.join(self._places[place])}")
        if not secrets.compare_digest(self._token(environ).encode(), self.token.encode()):
            if place == "/":
                return HTTPStatus.UNAUTHORIZED, self._lost
            raise _Refused(HTTPStatus.UNAUTHORIZED, _LOST)
        return served(environ)

    def _token(self, environ: Mapping[str, Any]) -> str:
        if environ["PATH_INFO"] != "/":
            return str(environ.get(f"HTTP_{TOKEN.upper().replace('-', '_')}", ""))
        return str(parse_qs(environ.get("QUERY_STRING", "")).get("token", [""])[0])

    def _page(self, environ: Mapping[str, Any]) -> tuple[HTTPStatus, bytes]:
        return HTTPStatus.OK, self.page

    def _look(self, environ: Mapping[str, Any]) -> tuple[HTTPStatus, bytes]:
        return HTTPStatus.OK, _json(self.worker.look())

    def _cancel(self, environ: Mapping[str, Any]) -> tuple[HTTPStatus, bytes]:
        return HTTPStatus.OK, _json(self.worker.cancel())

    def _give(self, environ: Mapping[str, Any]) -> tuple[HTTPStatus, bytes]:
        if environ.get("CONTENT_TYPE", "").partition(";")[0].strip() != "application/json":
            raise _Refused(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "a job is JSON: its Content-Type is application/json")
        try:
            request = json.loads(environ["wsgi.input"].read(BODY + 1))
        except (ValueError, RecursionError) as error:
            raise _Refused(HTTPStatus.BAD_REQUEST, f"this is no JSON: {error}") from None
        kind = request.get("kind") if isinstance(request, dict) else None
        if not isinstance(kind, str):
            raise _Refused(HTTPStatus.BAD_REQUEST, "this is no job: it has no kind")
        if kind not in JOB_KINDS:
            raise _Refused(HTTPStatus.BAD_REQUEST, str(unknown_name(kind, JOB_KINDS, f"job {kind!r}")))
        try:
            return HTTPStatus.ACCEPTED, _json(self.worker.give(kind, request))
        except Busy as error:
            raise _Refused(HTTPStatus.CONFLICT, str(error)) from None


def _json(content: Mapping[str, Any]) -> bytes:
    return json.dumps(content).encode()


def _hashes(page: str) -> str:
    """Return the hashes of a page's scripts for its content policy."""
    scripts = re.findall(r"<script>(.*?)</script>", page, flags=re.DOTALL)
    found = (base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts)
    return " ".join(f"'sha256-{one}'" for one in found)


def hosts_of(port: int) -> tuple[str, ...]:
    """Return the host names that a browser sends for a server at a port; the usual port is left out."""
    return tuple(name if port == 80 else f"{name}:{port}" for name in (ADDRESS, "localhost"))


class Server:
    """An `Application` that listens.

    Parameters
    ----------
    page : str
    port : int
        One that is free by default.

    Raises
    ------
    InputError
        If the port is taken.
    """

    def __init__(self, page: str, port: int = 0) -> None:
        self.worker = Worker()
        self.application = Application(page, self.worker)
        listening = socket.socket()
        try:
            if os.name == "posix":  # elsewhere it would let another process listen, too
                listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listening.bind((ADDRESS, port))
        except OSError as error:
            listening.close()
            raise InputError(f"port {port} of {ADDRESS} cannot be listened at: {error.strerror or error}") from None
        self._sockets: dict[int, Any] = {}
        self._server = create_server(
            self.application,
            map=self._sockets,
            sockets=[listening],
            ident=None,
            threads=4,
            connection_limit=CONNECTIONS,
            cleanup_interval=1,
            max_request_body_size=BODY,
            max_request_header_size=HEAD,
        )
        self._server.maintenance = self._close_silent
        self.port = int(listening.getsockname()[1])
        self.application.hosts = hosts_of(self.port)

    @property
    def address(self) -> str:
        """Return the address of the page with its token."""
        return f"http://{ADDRESS}:{self.port}/?token={self.application.token}"

    def run(self) -> None:
        """Serve until Ctrl-C, or until `stop` is called from another thread; then end what is being done."""
        try:
            self._server.run()
        finally:
            self.worker.stop()
            self._server.task_dispatcher.shutdown()
            self._close()

    def stop(self) -> None:
        """End `run`."""
        trigger = self._server.trigger
        with trigger.lock:  # or the loop, woken by an answer just given, closes the trigger before it is pulled
            trigger.thunks.append(self._close)
            trigger.pull_trigger()

    def _close_silent(self, now: float) -> None:
        """Close connections that have said nothing for some time and wait for no answer; waitress calls this each second."""
        silence = SILENCE if len(self._sockets) < CONNECTIONS // 2 else SHORT_SILENCE
        for channel in self._server.active_channels.values():
            if not channel.requests and channel.last_activity < now - silence:
                channel.will_close = True

    def _close(self) -> None:
        wasyncore.close_all(self._sockets, ignore_all=True)
