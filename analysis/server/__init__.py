"""What the studio does with Python behind it: a server on this machine alone, a process that works for it, and the jobs."""

from .application import BODY, TOKEN, Application, Server
from .worker import Busy, Worker

__all__ = ["BODY", "TOKEN", "Application", "Busy", "Server", "Worker"]
