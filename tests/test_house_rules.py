"""Rules for all code of the package: which modules write files, and how functions are called."""

import ast
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "analysis"
#: Who writes, and what.
WRITERS = {
    "files": "results, in whole and never over what another command wrote",
    "cli": "what a command makes",
    "export": "FMUs and the sources that they are compiled from",
    "probe": "a working folder for an FMU under test",
    "numerics/cache.py": "machine code and packages in the cache",
    "numerics/workers.py": "results of workers in a temporary folder",
    "display.py": "a picture in memory",
    "studies/page.py": "plots of the theses' pages",
    "systems/many.py": "runs of a system, with which a later call goes on",
}
METHODS = {"write_text", "write_bytes", "savefig", "savetxt", "tofile", "copyfile", "copytree"}


def writes(call: ast.Call) -> bool:
    """Whether a call writes a file: a method such as ``path.write_text``, or opening for writing."""
    name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    if name in ("open", "ZipFile"):
        values = [*call.args, *(keyword.value for keyword in call.keywords)]
        modes = [v.value for v in values if isinstance(v, ast.Constant) and isinstance(v.value, str)]
        return any(len(mode) <= 3 and set(mode) & set("wax") for mode in modes)
    return name in METHODS and isinstance(call.func, ast.Attribute)


def test_only_some_modules_write_files() -> None:
    found = set()
    for path in PACKAGE.rglob("*.py"):
        place = path.relative_to(PACKAGE).as_posix()
        if any(isinstance(node, ast.Call) and writes(node) for node in ast.walk(ast.parse(path.read_text("utf-8")))):
            found.add(place if place in WRITERS else place.partition("/")[0])
    assert found == set(WRITERS)


#: What a name does not end in; those of CasADi, and a state, do.
PREPOSITIONS = (
    "of in on at by with from to for between under over into beside along after before through until within about"
)
ALLOWED = {"get_n_in", "get_sparsity_in", "is_switched_on", "_is_switched_on"}


def test_no_function_ends_in_a_preposition() -> None:
    ends, found = tuple(f"_{word}" for word in PREPOSITIONS.split()), set()
    for folder in ("analysis", "fmu_src", "benchmarks"):
        for path in (PACKAGE.parent / folder).rglob("*.py"):
            nodes = ast.walk(ast.parse(path.read_text("utf-8")))
            found |= {node.name for node in nodes if isinstance(node, ast.FunctionDef) and node.name.endswith(ends)}
    assert found == ALLOWED
