"""Server of the studio, for this machine only: web application, worker process and jobs."""

from .application import BODY, TOKEN, Application, Server
from .worker import Busy, Worker

__all__ = ["BODY", "TOKEN", "Application", "Busy", "Server", "Worker"]
