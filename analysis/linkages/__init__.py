"""Planar linkages of the user's own: described as data, compiled into mechanisms."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from linkwork.mechanism import Mechanism

from .. import files
from .description import Description as Description
from .description import LinkageError as LinkageError
from .package import Package as Package
from .package import mechanism as mechanism


def described(data: Mapping[str, Any], name: str = "linkage") -> Description:
    """Read a description from nested tables."""
    return files.read(Description, data, name)
