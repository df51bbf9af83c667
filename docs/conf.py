"""Settings of the documentation's site: ``make docs`` builds it with Sphinx into build/site, and it works without a network."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert

from analysis.cli import COMMANDS
from linkwork import __version__

sys.path.insert(0, str(Path(__file__).parent))
import openings

project = "Linkwork"
author = copyright = "The Linkwork developers"
version = release = __version__

extensions = ["myst_nb", "numpydoc", "sphinx.ext.autodoc", "sphinx_click"]
exclude_patterns = ["**.ipynb_checkpoints"]
html_theme = "furo"  # its fonts are those of the reader's machine
html_title = f"Linkwork {__version__}"
html_static_path = ["site.css"]
html_css_files = ["site.css"]
html_copy_source = False
html_extra_path = ["../analysis/studio/page.html"]  # the studio, which the links of `openings` open

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
smartquotes = False  # would make a dash of the two hyphens before an option

# notebooks are stored without outputs, and run when the site is built; an error in a cell is an error of the build
nb_execution_mode = "force"
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_merge_streams = True
nb_output_stderr = "remove"  # what is compiled, once on a machine

default_role = "py:obj"  # of a docstring's single backticks: a link where the name is known
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the signature would repeat what the sections of numpydoc state
numpydoc_show_class_members = False
add_module_names = False

html_math_renderer = "mathml"

#: Links between files of the repository, which are other pages or none on the site.
LINKS = (
    (r"\]\((?:\.\./)?(CONTRIBUTING|CHANGELOG)\.md", lambda match: f"]({match[1].lower()}.md"),
    (r"\]\((?:\.\./)?docs/", lambda match: "]("),
    (r"\[([\w ]+)\]\((?:paper/paper|CODE_OF_CONDUCT)\.md\)", lambda match: match[1]),
    (r"\]\((?=CITATION|LICENSE|examples/)", lambda match: "](../"),
)


def relink(text: list[str]) -> None:
    """Redirect the links of a source page to the pages of the site."""
    for pattern, replacement in LINKS:
        text[0] = re.sub(pattern, replacement, text[0])


def write_formula(translator: Any, node: Any) -> None:
    """Write a formula as MathML, which every browser draws without a script."""
    from docutils import nodes

    display = "inline" if isinstance(node, nodes.math) else "block"
    translator.body.append(convert(node.astext(), display=display))
    raise nodes.SkipNode


def list_commands(app: Any, name: str, text: list[str]) -> None:
    """Put every command with its options on the page of commands.

    Groups of commands import their members only when called, so that Sphinx cannot list them by itself.
    """
    if name != "reference/commands":
        return
    for command, (module, _) in COMMANDS.items():
        function = f"analysis.cli.{module}:{command.replace('-', '_')}"
        text[0] += f"\n```{{eval-rst}}\n.. click:: {function}\n   :prog: linkwork {command}\n   :nested: full\n```\n"


def open_in_the_studio(app: Any, name: str, text: list[str]) -> None:
    """Put links that open a page's mechanisms in the studio under its heading."""
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
