"""The sources of native FMUs in one program: both mechanisms and both standards, each behind its prefix."""

from pathlib import Path

import pytest

from analysis.export import NATIVE, NATIVE_FMI3, compile_library, source_files, this_platform
from analysis.export.description import token
from analysis.export.native_fmu import COMPILED, PLATFORMS
from build_fmu import FMUS
from tests.scripts import called

_MAIN = """
#include <stdio.h>
#include "fmi2Functions.h"
#include "fmi3Functions.h"
static fmi2CallbackFunctions callbacks;
{declarations}
int main(void) {{
{calls}
    return 0;
}}
"""
_CALLS = {
    2: """
    {{
        fmi2Component c = {p}fmi2Instantiate("a", fmi2CoSimulation, "{token}", "", &callbacks, 0, 0);
        fmi2ValueReference r = {reference};
        double angle;
        if (!c || {p}fmi2EnterInitializationMode(c) || {p}fmi2ExitInitializationMode(c) ||
            {p}fmi2DoStep(c, 0.0, 0.1, 1)) return 1;
        {p}fmi2GetReal(c, &r, 1, &angle);
        printf("%.17g\\n", angle);
    }}""",
    3: """
    {{
        fmi3Instance c = {p}fmi3InstantiateCoSimulation("a", "{token}", 0, 0, 0, 0, 0, 0, 0, 0, 0, 0);
        fmi3ValueReference r = {reference};
        double angle, reached;
        fmi3Boolean x, y, z;
        if (!c || {p}fmi3EnterInitializationMode(c, 0, 0.0, 0.0, 0, 0.0) || {p}fmi3ExitInitializationMode(c) ||
            {p}fmi3DoStep(c, 0.0, 0.1, 1, &x, &y, &z, &reached)) return 1;
        {p}fmi3GetFloat64(c, &r, 1, &angle, 1);
        printf("%.17g\\n", angle);
    }}""",
}
_USED = {
    2: "Instantiate EnterInitializationMode ExitInitializationMode DoStep GetReal",
    3: "InstantiateCoSimulation EnterInitializationMode ExitInitializationMode DoStep GetFloat64",
}


@pytest.mark.slow
@pytest.mark.skipif(not this_platform().endswith("linux"), reason="the test reads ELF with nm")
def test_all_link_into_one_program(tmp_path: Path) -> None:
    target = PLATFORMS[this_platform()].target
    options = ("-std=c11", "-O0", "-fno-sanitize=undefined", "-Wall", "-Werror", "-Wno-unused-function")
    declarations, calls, objects, angles = [], [], [], []
    for mechanism in FMUS.values():
        for kind in (NATIVE, NATIVE_FMI3):
            prefix = f"{kind.identifier(mechanism)}_"
            folder = tmp_path / prefix
            folder.mkdir()
            for name, text in source_files(mechanism, kind).items():
                (folder / name).write_text(text, encoding="utf-8")
                if name.startswith("fmi") and name.endswith(".h"):
                    (tmp_path / name).write_text(text, encoding="utf-8")
            given = f"-DFMI{kind.fmi}_FUNCTION_PREFIX={prefix}"
            compile_library(folder, COMPILED, f"{prefix}.o", target, (*options, "-c", given))
            objects.append(f"{prefix}/{prefix}.o")
            names = [v.name for v in mechanism.variables]
            key, reference = token(mechanism, kind), names.index("crank.angle")
            calls.append(_CALLS[kind.fmi].format(p=prefix, token=key, reference=reference))
            declarations += [f"fmi{kind.fmi}{f}TYPE {prefix}fmi{kind.fmi}{f};" for f in _USED[kind.fmi].split()]
            speed = next(v.start for v in mechanism.variables if v.name == "drive.speed")
            angles.append(0.1 * float(speed))
            symbols = called("nm", "-g", "--defined-only", tmp_path / objects[-1])
            visible = [line.split()[-1] for line in symbols.splitlines()]
            assert visible
            assert [name for name in visible if not name.startswith(f"{prefix}fmi{kind.fmi}")] == []
    main = _MAIN.format(declarations="\n".join(declarations), calls="".join(calls))
    (tmp_path / "main.c").write_text(main, encoding="utf-8")
    compile_library(tmp_path, ["main.c", *objects], "program", target, (*options, "-lm"))
    printed = called(tmp_path / "program").split()
    assert [float(text) for text in printed] == pytest.approx(angles, rel=1e-12)
