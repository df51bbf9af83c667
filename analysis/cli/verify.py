"""`linkwork verify`: verify an FMU by the experiments that the FMU contains."""

from __future__ import annotations

import click

from .common import CHECK_FAILED, console, fail, note, print_error, report_errors, say, show_table, tolerance_option


@click.command()
@click.argument("fmu", type=click.Path(exists=True, dir_okay=False))
@tolerance_option(
    help="Greatest relative difference; by default the one stated in the FMU, or 100 times the solver's tolerance."
)
@click.option("--rebuild", is_flag=True, help="Compile an FMU of Linkwork again from its own sources, and compare.")
@report_errors
def verify(fmu: str, tolerance: float | None, rebuild: bool) -> None:
    """Run the experiments that an FMU of any make contains (FMI-LS-REF), and compare with its reference results.

    The command prints the largest difference in each experiment, relative to the variable's scale. The exit code is 4 if a
    difference is too large.

    With --rebuild, for an FMU built by Linkwork, the command compares the files of the FMU with its bill of materials, and its
    libraries with libraries compiled here from its sources.

    \b
    Examples:
      linkwork verify build/FiveBarSlider-native.fmu
      linkwork verify other.fmu --tolerance 1e-4
      linkwork verify build/FiveBarSlider-native.fmu --rebuild
    """
    if rebuild:
        _rebuild(fmu)
        return
    from ..run import verify as verify_fmu

    outcomes, rows, failed, interface = list(verify_fmu(fmu, allowed=tolerance)), [], [], ""
    for outcome in outcomes:
        interface = outcome.interface
        if not outcome.passed:
            failed.append(outcome)
        beyond = [d for d in outcome.deviations if d.relative > outcome.allowed] or list(outcome.deviations[:1])
        cells = [
            (d.name, f"{d.time:.4g}", f"{d.value:.7g}", f"{d.reference:.7g} {d.unit}", f"{d.relative:.1e}")
            for d in beyond
        ] or [("", "", "", "", "")]
        verdict = "pass" if outcome.passed else "FAIL"
        rows += [(outcome.experiment, *cell, f"{outcome.allowed:.0e}", verdict) for cell in cells[:5]]
    show_table(
        f"{fmu}, {interface}",
        ("experiment", "variable", "at [s]", "value", "reference", "relative", "allowed", "verdict"),
        rows,
        unwrapped=("experiment", "variable", "value", "reference", "verdict"),
        styles=[None if row[-1] == "pass" else "red" for row in rows],
    )
    for outcome in failed:
        if outcome.message:
            print_error(f"{outcome.experiment}: {outcome.message}", "red")
    if failed:
        fail(f"verify failed: {', '.join(outcome.experiment for outcome in failed)}", CHECK_FAILED)
    if alone := [outcome.experiment for outcome in outcomes if not outcome.deviations]:
        note(f"without reference results, so that nothing was compared: {', '.join(alone)}")
    say(f"{len(outcomes)} of {len(outcomes)} experiments pass", style="green")


def _rebuild(fmu: str) -> None:
    """Print for each part of an FMU whether a rebuild from its sources is identical; exit with an error code if one differs."""
    from ..export import rebuild as rebuild_fmu

    with console.status("building"):
        parts = list(rebuild_fmu(fmu))
    rows = [(part.what, part.text, "same" if part.same else "DIFFERS") for part in parts]
    styles = [None if part.same else "red" for part in parts]
    show_table(fmu, ("part", "compared with", "verdict"), rows, styles=styles)
    if not all(part.same for part in parts):
        text = "rebuild failed: the FMU differs from a build from its sources with the programs installed here"
        fail(text, CHECK_FAILED)
    say("the FMU is the same as a build from its sources", style="green")
