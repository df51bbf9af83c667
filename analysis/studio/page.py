"""Build the studio's web page, one HTML file beside this module, from `studio/` and the registry of mechanisms.

The page opens with a given state of a mechanism.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from linkwork.errors import InputError

from ..export import SOURCES
from ..mechanisms import MECHANISMS
from ..periodic import TOLERANCE
from .state import opening_state
from .tables import mechanism_tables

#: The built page.
PAGE = Path(__file__).with_name("page.html")
#: Root of a checkout, and in it the page without mechanisms, as `npm run build` writes it.
ROOT = SOURCES.parent
TEMPLATE = ROOT / "studio" / "build" / "page.html"
#: Patterns of the files of a checkout from which the page is made.
_MADE_OF = (
    "analysis/export/equations_c.py",
    "analysis/export/web.py",
    "analysis/export/browser/*",
    "analysis/studio/*.py",
    "fmu_src/linkwork/**/*.py",
    "fmu_src/native/model.h",
    "fmu_src/native/plant.*",
    "fmu_src/native/step.h",
    "studio/*.*",
    "studio/src/*",
)
_SCRIPT = r'(<script type="application/json" id="{}">)(.*?)(</script>)'
_HASH = '<meta name="sources" content="{}">'


def hash_of_sources() -> str:
    """Return the hash (SHA-256) of all files of the checkout from which the page is made."""
    found = hashlib.sha256()
    for path in sorted({path for pattern in _MADE_OF for path in ROOT.glob(pattern) if path.is_file()}):
        found.update(f"{path.relative_to(ROOT).as_posix()}\n".encode())
        found.update(path.read_bytes())
    return found.hexdigest()


def is_current() -> bool:
    """Return whether the page was built from the sources of this checkout."""
    return _HASH.format(hash_of_sources()) in PAGE.read_text(encoding="utf-8")


def build_page() -> str:
    """Add all registered mechanisms, compiled to WebAssembly by Zig, to the page that `npm run build` wrote; return the HTML.

    Raises
    ------
    InputError
        If `npm run build` has not written its page.
    """
    if not TEMPLATE.is_file():
        raise InputError(f"{TEMPLATE} is not there: npm run build in {TEMPLATE.parents[1]} writes it")
    template = TEMPLATE.read_text(encoding="utf-8").replace("<title>", f"{_HASH.format(hash_of_sources())}\n<title>", 1)
    made = [mechanism_tables(m) for m in MECHANISMS.values()]
    tables = {"tolerance": TOLERANCE, "mechanisms": made}
    return _replace_script(_replace_script(template, "tables", tables), "state", opening_state())


def make_page(state: Mapping[str, Any]) -> str:
    """Return the HTML of the built page with an opening state.

    If the built page lacks the mechanism of this state, the returned page has this mechanism beside its own.

    Raises
    ------
    BuildError
        If the mechanism has to be compiled, and cannot be.
    """
    page = PAGE.read_text(encoding="utf-8")
    tables = json.loads(re.search(_SCRIPT.format("tables"), page, re.DOTALL)[2])  # type: ignore[index]
    if all(mechanism["name"] != state["mechanism"] for mechanism in tables["mechanisms"]):
        tables["mechanisms"].append(mechanism_tables(MECHANISMS[state["mechanism"]]))
        page = _replace_script(page, "tables", tables)
    return _replace_script(page, "state", state)


def page_address(state: Mapping[str, Any], page: str) -> str:
    """Return the address that opens the page at the address ``page`` with a state, in the form that the page itself writes.

    Values that are equal to their start values are left out.
    """
    start = {variable.name: variable.start for variable in MECHANISMS[state["mechanism"]].variables}
    values = {name: value for name, value in state["values"].items() if value != start.get(name)}
    text = json.dumps(dict(state) | {"values": values}, separators=(",", ":"), ensure_ascii=False)
    return f"{page}#state={base64.urlsafe_b64encode(text.encode()).decode().rstrip('=')}"


def _replace_script(page: str, script: str, data: Any) -> str:
    """Return the page with ``data`` in the JSON script whose id is ``script``."""
    text = json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")
    return re.sub(_SCRIPT.format(script), lambda found: found[1] + text + found[3], page, count=1, flags=re.DOTALL)
