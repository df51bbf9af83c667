"""The documentation repeats the code where it says so, and its code runs."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import pytest

import build_fmu
from analysis.studies import STUDIES

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def generate():
    spec = importlib.util.spec_from_file_location("generate", ROOT / "docs" / "generate.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_nomenclature_is_up_to_date(generate):
    assert (ROOT / "docs" / "nomenclature.md").read_text() == generate.nomenclature(), "run: python docs/generate.py"


def test_the_variable_table_of_the_readme_is_up_to_date(generate):
    text = (ROOT / "README.md").read_text()
    assert generate.readme(text) == text, "run: python docs/generate.py"


def test_every_study_is_on_the_page_of_the_figures():
    page = (ROOT / "docs" / "youssef-figures.md").read_text()
    for number, title in STUDIES.items():
        assert title in page, f"{number}: run python docs/generate.py --figures"


def test_links_in_the_documentation_lead_somewhere():
    for page in (ROOT / "README.md", *(ROOT / "docs").glob("*.md")):
        for target in re.findall(r"\]\(([^)#:]+)\)", page.read_text()):
            assert (page.parent / target).exists(), f"{page.name}: {target}"


def test_the_code_of_the_readme_runs(tmp_path):
    build_fmu.build("FiveBarSlider", tmp_path / "build")
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), flags=re.DOTALL)
    assert len(blocks) == 3
    for block in blocks:
        assert len(block.strip().splitlines()) <= 12
        done = subprocess.run(
            [sys.executable, "-c", block], cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False
        )
        assert done.returncode == 0, done.stderr
