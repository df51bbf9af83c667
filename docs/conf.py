"""Settings of the documentation site: ``make docs`` builds it with Sphinx into build/site; the site works without a network."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

from jinja2.sandbox import SandboxedEnvironment
from latex2mathml.converter import convert
from numpydoc import docscrape_sphinx

from analysis.cli import COMMANDS
from linkwork import __version__

sys.path.insert(0, str(Path(__file__).parent))
import openings

# numpydoc makes an environment, and compiles its template, for every docstring anew: the first one serves them all
_FIRST: dict[str, Any] = {}
docscrape_sphinx.SandboxedEnvironment = lambda loader: _FIRST.setdefault("", SandboxedEnvironment(loader=loader))

project = "Linkwork"
author = copyright = "The Linkwork developers"
version = release = __version__

extensions = ["myst_nb", "numpydoc", "sphinx.ext.autodoc", "sphinx_click"]
exclude_patterns = ["**.ipynb_checkpoints"]
html_theme = "furo"  # uses the fonts of the reader's machine
html_title = f"Linkwork {__version__}"
html_static_path = ["site.css"]
html_css_files = ["site.css"]
html_copy_source = False
html_extra_path = ["../analysis/studio/page.html"]  # the studio, which the links of `openings` open

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
smartquotes = False  # they would turn the two hyphens before an option into a dash

# notebooks are stored without outputs, and run when the site is built; an error in a cell is an error of the build
nb_execution_mode = "force"
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_merge_streams = True
nb_output_stderr = "remove"  # messages of the compiler, which appear only once on a machine

default_role = "py:obj"  # single backticks in a docstring link to the object if its name is known
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the signature would repeat what the sections of numpydoc state
numpydoc_show_class_members = False
add_module_names = False

html_math_renderer = "mathml"

#: Patterns of links between files of the repository, each with its replacement: the page on the site, or no link.
LINKS = (
    (r"\]\((?:\.\./)?(CONTRIBUTING|CHANGELOG)\.md", lambda match: f"]({match[1].lower()}.md"),
    (r"\]\((?:\.\./)?docs/", lambda match: "]("),
    (r"\[([\w ]+)\]\((?:paper/paper|CODE_OF_CONDUCT)\.md\)", lambda match: match[1]),
    (r"\]\((?=CITATION|LICENSE|examples/)", lambda match: "](../"),
)


def relink(text: list[str]) -> None:
    """Replace links to files of the repository in a source page by links to pages of the site.

    ``text`` has the page as its only element, as Sphinx passes it; it is changed in place.
    """
    for pattern, replacement in LINKS:
        text[0] = re.sub(pattern, replacement, text[0])


def write_formula(translator: Any, node: Any) -> None:
    """Write a formula as MathML, which every browser draws without a script."""
    from docutils import nodes

    display = "inline" if isinstance(node, nodes.math) else "block"
    translator.body.append(convert(node.astext(), display=display))
    raise nodes.SkipNode


def list_commands(app: Any, name: str, text: list[str]) -> None:
    """Add every command with its options to the page of commands.

    Sphinx cannot list the commands by itself, because groups of commands import their members only when called.
    """
    if name != "reference/commands":
        return
    for command, (module, _) in COMMANDS.items():
        function = f"analysis.cli.{module}:{command.replace('-', '_')}"
        text[0] += f"\n```{{eval-rst}}\n.. click:: {function}\n   :prog: linkwork {command}\n   :nested: full\n```\n"


def open_in_the_studio(app: Any, name: str, text: list[str]) -> None:
    """Add a line with links that open the page's mechanisms in the studio, under the page's heading."""
    heading, line, rest = text[0].partition("\n")
    if "/" not in name and (found := openings.links(name, text[0])):
        text[0] = f"{heading}{line}\n{found}\n{rest}"


def setup(app: Any) -> None:
    """Connect the functions of this file to Sphinx."""
    app.add_html_math_renderer("mathml", (write_formula, None), (write_formula, None))
    app.connect("source-read", lambda app, name, text: relink(text))
    app.connect("source-read", list_commands)
    app.connect("source-read", open_in_the_studio)
    app.connect("include-read", lambda app, path, name, text: relink(text))
