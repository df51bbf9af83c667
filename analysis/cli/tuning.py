"""`linkwork tune`: tune parameters so that a range of speeds has wanted properties."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from . import common


@click.command()
@click.argument("case", type=click.Path(exists=True, dir_okay=False))
@common.set_option("slider.damping='2 N*s/m' or tune.least_margin=0.1; lists as in TOML")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON instead of tables.")
@common.plot_option
@common.out_option()
@common.report_errors
def tune(case: str, settings: Sequence[str], as_json: bool, plot: bool, out: str) -> None:
    """Find the least change of parameters of a CASE file (TOML or JSON) that gives a range of speeds the properties in [tune].

    Possible properties are: no resonance, jump or unstable motion in the range; outputs below their limits; or the least
    damping with which the other properties hold. The result is verified: the response is computed again, a row of a stability
    chart is computed, and all periodic motions are sought. The command writes a case with the changed parameters, the result as
    JSON, and a picture. If the requirements cannot be met, it writes the nearest result, and the exit code is 4.

    \b
    Examples:
      linkwork tune examples/tuning.toml
      linkwork tune examples/tuning.toml --set tune.speeds='["1150 rpm", "1190 rpm"]'
    """
    import json

    from ..files import write_tables
    from ..tuning import load_tuning_case
    from ..tuning import tune as find

    overrides = common.changes(settings, 'tune.speeds=\'["1150 rpm", "1190 rpm"]\'')
    common.check_kind(case, common.TUNING, settings=overrides)
    chosen = load_tuning_case(case, overrides)
    tuned = find(chosen.wish, progress=common.console.is_terminal)
    tables = tuned.tables()
    if as_json:
        click.echo(json.dumps(tables, indent=2))
    else:
        _print(chosen.title, tuned)
    folder = common.output_folder(out)
    stem = folder / f"{Path(case).stem}-tuned"
    written = [write_tables(f"{stem}.toml", chosen.tuned_tables(tuned, folder)), write_tables(f"{stem}.json", tables)]
    written += common.save_plot(plot, tuned, f"{stem}.png", title=chosen.title)
    if not as_json:
        common.print_paths(written)
    for sentence in tuned.missed:
        common.note(sentence)
    if not tuned.met:
        sys.exit(common.CHECK_FAILED)


def _print(title: str, tuned: Any) -> None:
    from ..mechanisms import find_mechanism
    from ..periodic import parameter_unit
    from ..units import display_scale

    wish = tuned.wish
    rows = []
    for name, before, after in zip(wish.names, wish.present.tolist(), tuned.values.tolist()):
        # a change from zero has no percentage
        unit, factor = display_scale(parameter_unit(find_mechanism(wish.parameters), name))
        change = f"{100.0 * (after / before - 1.0):+.4g} %" if before else f"{factor * after:+.4g} {unit}"
        changed = change if after != before else "none"
        rows.append((name, unit, f"{factor * before:.7g}", f"{factor * after:.7g}", changed))
    headings = ("parameter", "unit", "before", "after", "change")
    common.show_table(f"{title}: the least change", headings, rows)
    headings = ("requirement", "wished", "before", "after", "")
    rows = [(r.name, r.wished, r.before.text, r.after.text, "met" if r.met else "not met") for r in tuned.requirements]
    styles = [None if r.met else "yellow" for r in tuned.requirements]
    common.show_table("requirements", headings, rows, styles=styles)
    common.say(f"verified: {tuned.verification}" if tuned.met else f"computed anew: {tuned.verification}")
