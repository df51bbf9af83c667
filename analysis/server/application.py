"""The web server of the studio: it listens on the loopback address only, and serves one page to requests with its token."""

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
from .worker import Busy, Worker

try:
    from waitress import wasyncore
    from waitress.server import create_server
except ImportError as error:
    raise MissingLibraryError("waitress") from error

#: The only address at which the server listens; greatest size of a request's body and of its head (bytes); greatest number of
#: connections, below the 512 that Windows can wait for.
ADDRESS, BODY, HEAD, CONNECTIONS = "127.0.0.1", 512_000, 16_000, 400
#: Seconds of silence after which a connection is closed; the same if more than half of all connections are open.
SILENCE, SHORT_SILENCE = 30.0, 2.0
#: Header in which the page sends its token.
TOKEN = "X-Linkwork-Token"
#: Kinds of jobs: the names in `jobs.JOBS`, which is not imported here as this takes a second.
JOB_KINDS = ("linkages", "slider", "tune", "run", "export")
_LOST = "the token is missing or wrong: open the address that linkwork studio printed"
#: Served instead of the page if the address has no token: its script takes the token from the browser's storage, where the page
#: has put it.
_LOST_PAGE = f"""<!doctype html><html lang="en"><meta charset="utf-8"><title>linkwork studio</title><p>{_LOST}</p><script>
const token = localStorage.getItem("linkwork-token");
if (token && !location.search) location.replace(`/?token=${{encodeURIComponent(token)}}${{location.hash}}`);
</script></html>"""

_HEADERS = [
    ("Cache-Control", "no-store"),
    ("Cross-Origin-Opener-Policy", "same-origin"),
    ("Cross-Origin-Resource-Policy", "same-origin"),
    ("Referrer-Policy", "no-referrer"),
    ("X-Content-Type-Options", "nosniff"),
    ("X-Frame-Options", "DENY"),
]
#: Content policy of a page: it may load nothing but itself; the hashes of its scripts are inserted.
_POLICY = (
    "default-src 'none'; script-src 'wasm-unsafe-eval' {}; worker-src blob:; style-src 'unsafe-inline'; "
    "img-src data: blob:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)

_Start = Callable[[str, list[tuple[str, str]]], Any]


class _Refused(Exception):
    """Error for a request that is refused; an HTTP status and a sentence give the reason."""

    def __init__(self, status: HTTPStatus, sentence: str) -> None:
        self.status, self.sentence = status, sentence
        super().__init__(sentence)


class Application:
    """WSGI application that serves a page and accepts its jobs.

    A request must name this machine as its host, must not come from another page, and must have the token, in the address of
    the page or in a header. The first rule refuses foreign pages that reach the server under another name. The server has two
    paths, the page and its job; a path is looked up in a table, never on a disk.

    Parameters
    ----------
    page : str
        HTML of the page with its opening state.
    worker : Worker
        Worker that does the jobs.
    """

    def __init__(self, page: str, worker: Worker) -> None:
        # imported here: it takes a second
        from ..synthesis import Kind

        self.worker = worker
        self.token = secrets.token_urlsafe(32)
        #: Host names of this server, set when it listens.
        self.hosts: tuple[str, ...] = ()
        # a tag tells the page that there is a server, and which kinds of linkages it can search
        mark = f'<meta name="linkwork-server" content="{" ".join(get_args(Kind))}">'
        self.page = page.replace("<title>", f"{mark}\n<title>", 1).encode()
        self._lost = _LOST_PAGE.encode()
        self._policy = _POLICY.format(_hashes(page + _LOST_PAGE))
        self._places: dict[str, dict[str, Callable[[Mapping[str, Any]], tuple[HTTPStatus, bytes]]]] = {
            "/": {"GET": lambda _: (HTTPStatus.OK, self.page)},
            "/job": {
                "GET": lambda _: (HTTPStatus.OK, _json(worker.look())),
                "POST": self._post_job,
                "DELETE": lambda _: (HTTPStatus.OK, _json(worker.cancel())),
            },
        }

    def __call__(self, environ: Mapping[str, Any], start: _Start) -> Iterable[bytes]:
        headers = list(_HEADERS)
        try:
            status, body = self._serve(environ)
        except _Refused as refused:
            status, body = refused.status, _json({"sentence": refused.sentence})
        page = body is self.page or body is self._lost
        headers.append(("Content-Type", "text/html; charset=utf-8" if page else "application/json"))
        headers.append(("Content-Security-Policy", self._policy if page else "default-src 'none'"))
        headers.append(("Content-Length", str(len(body))))
        start(f"{status.value} {status.phrase}", headers)
        return [body]

    def _serve(self, environ: Mapping[str, Any]) -> tuple[HTTPStatus, bytes]:
        if environ.get("HTTP_HOST") not in self.hosts:
            raise _Refused(
                HTTPStatus.MISDIRECTED_REQUEST,
                "this server answers only at its own address: open the one that linkwork studio printed; a tunnel must "
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
            raise _Refused(HTTPStatus.METHOD_NOT_ALLOWED, f"this path allows only {', '.join(self._places[place])}")
        if not secrets.compare_digest(self._token(environ).encode(), self.token.encode()):
            if place == "/":
                return HTTPStatus.UNAUTHORIZED, self._lost
            raise _Refused(HTTPStatus.UNAUTHORIZED, _LOST)
        return served(environ)

    def _token(self, environ: Mapping[str, Any]) -> str:
        if environ["PATH_INFO"] != "/":
            return str(environ.get(f"HTTP_{TOKEN.upper().replace('-', '_')}", ""))
        return str(parse_qs(environ.get("QUERY_STRING", "")).get("token", [""])[0])

    def _post_job(self, environ: Mapping[str, Any]) -> tuple[HTTPStatus, bytes]:
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
    """Return the hashes of a page's scripts, in quotes, for the page's content security policy."""
    scripts = re.findall(r"<script>(.*?)</script>", page, flags=re.DOTALL)
    found = (base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts)
    return " ".join(f"'sha256-{one}'" for one in found)


def allowed_hosts(port: int) -> tuple[str, ...]:
    """Return the Host headers that a browser may send to this server at a port; browsers omit port 80."""
    return tuple(name if port == 80 else f"{name}:{port}" for name in (ADDRESS, "localhost"))


class Server:
    """Server for an `Application`, which listens from the start.

    Parameters
    ----------
    page : str
        HTML of the page with its opening state.
    port : int
        Port; by default a free one.

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
        self.application.hosts = allowed_hosts(self.port)

    @property
    def address(self) -> str:
        """Return the address of the page with its token."""
        return f"http://{ADDRESS}:{self.port}/?token={self.application.token}"

    def run(self) -> None:
        """Serve until Ctrl-C, or until `stop` is called from another thread; then end the worker and its job."""
        try:
            self._server.run()
        finally:
            self.worker.stop()
            self._server.task_dispatcher.shutdown()
            self._close()

    def stop(self) -> None:
        """Make `run` return; to be called from another thread."""
        trigger = self._server.trigger
        with trigger.lock:  # otherwise the loop, woken by an answer, may close the trigger before it is pulled
            trigger.thunks.append(self._close)
            trigger.pull_trigger()

    def _close_silent(self, now: float) -> None:
        """Close connections that were silent for some time and wait for no answer; waitress calls this each second."""
        silence = SILENCE if len(self._sockets) < CONNECTIONS // 2 else SHORT_SILENCE
        for channel in self._server.active_channels.values():
            if not channel.requests and channel.last_activity < now - silence:
                channel.will_close = True

    def _close(self) -> None:
        wasyncore.close_all(self._sockets, ignore_all=True)
