"""`linkwork probe`: probe an FMU of any make."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from linkwork.errors import LinkworkError

from ..files import check_ending, write_tables, write_text
from ..probe import CRASH, SEVERITIES, WRONG, Finding, replay
from ..probe import probe as probe_fmu
from . import common


def _check_report(context: click.Context, parameter: click.Parameter, value: str | None) -> str | None:
    """Check, before the probe begins, that the report can be written and its ending is known (a callback of Click)."""
    if value is not None:
        try:
            check_ending(Path(value), (".md", ".json"))
        except LinkworkError as error:
            raise click.BadParameter(str(error)) from None
    return common.check_place(context, parameter, value)


@click.command()
@click.argument("fmu", type=click.Path(exists=True, dir_okay=False))
@click.option("--calls", default=20_000, type=click.IntRange(1), help="Number of random calls for each interface.")
@click.option("--seed", default=0, help="The same seed makes the same calls.")
@click.option(
    "--time",
    "seconds",
    default=600.0,
    type=click.FloatRange(0.0),
    help="Start no new random calls after this time (s).",
)
@click.option(
    "--interface",
    type=click.Choice(["cs", "me"]),
    help="Probe only this interface: co-simulation (cs) or model exchange (me).",
)
@click.option(
    "--hang", default=10.0, type=click.FloatRange(0.1), help="A call that takes longer than this (s) counts as hanging."
)
@click.option(
    "--check", "checks", multiple=True, metavar="CHECK", help="Run only this check; can be given several times."
)
@click.option(
    "--out", type=click.Path(dir_okay=False), callback=_check_report, help="File for the report: .md or .json."
)
@common.force_option
@click.option("--strict", is_flag=True, help="Fail also on questionable findings.")
@click.option(
    "--replay",
    "case",
    metavar="CASE",
    help="Run one case of a report again and show its calls, such as 0/cs/forbidden/12.",
)
@common.report_errors
def probe(
    fmu: str,
    calls: int,
    seed: int,
    seconds: float,
    interface: str | None,
    checks: Sequence[str],
    hang: float,
    out: str | None,
    strict: bool,
    case: str | None,
) -> None:
    """Probe an FMU of any make: random calls, legal and forbidden, saved states, derivatives, ranges, leaks, folders.

    The FMU runs in separate processes, so that a crash is a finding. The exit code is 4 if the FMU crashes or does something
    wrong.

    \b
    Examples:
      linkwork probe build/FiveBarSlider.fmu
      linkwork probe other.fmu --calls 1000000 --seed 7 --out report.md
      linkwork probe other.fmu --replay 7/cs/forbidden/12
    """
    if case is not None:
        lines, findings = replay(fmu, case, hang=hang)
        for line in lines:
            common.say(line)
    else:
        with common.console.status("probing") as status:
            report = probe_fmu(
                fmu, calls=calls, seed=seed, seconds=seconds, interface=interface, hang=hang, checks=checks,
                progress=lambda what: status.update(f"probing {what}"),
            )  # fmt: skip
        findings = report.findings
        if out is not None:
            markdown = Path(out).suffix.lower() == ".md"
            path = write_text(out, report.to_markdown()) if markdown else write_tables(out, report.to_dict())
            common.print_paths([path])
        rows = [(o.check, o.interface, str(o.cases), str(o.calls), f"{o.seconds:.1f}", o.said) for o in report.outcomes]
        headings = ("check", "interface", "cases", "calls", "s", "result")
        common.show_table(f"Probe of {report.fmu}", headings, rows)
    _show(findings)
    failing = SEVERITIES if strict else (CRASH, WRONG)
    failed = [finding for finding in findings if finding.severity in failing]
    if failed:
        common.fail(f"probe failed: {len(failed)} findings", common.CHECK_FAILED)
    common.say("no finding" if not findings else f"{len(findings)} questionable findings, nothing wrong")


def _show(findings: Sequence[Finding]) -> None:
    """Print a table of the findings, with one row for each severity and kind."""
    kinds: dict[tuple[str, str], list[Finding]] = {}
    for finding in findings:
        kinds.setdefault((finding.severity, finding.kind), []).append(finding)
    rows = []
    for (severity, kind), members in kinds.items():
        subjects = ", ".join(dict.fromkeys(m.subject for m in members))
        about = members[0].text if len(members) == 1 else f"{kind}: {subjects}"
        rows.append((severity, str(len(members)), about, members[0].replay))
    if rows:
        headings = ("severity", "kinds", "what", "replay")
        common.show_table("Findings", headings, rows)
