"""The `study` command: compute, check and draw a named study."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from indicial.cli.commands import app
from indicial.cli.outputs import to_folder

if TYPE_CHECKING:
    from indicial.studies import Study

Name = Annotated[
    str, typer.Argument(metavar="STUDY", help="Name of the study: bocian, finner, freeflight, plate or range.")
]
Compute = Annotated[
    str | None, typer.Option(metavar="PATTERN", help="Compute the missing pieces of these names ('*' for all).")
]
Recompute = Annotated[
    str | None,
    typer.Option(metavar="SUBSET", help="Compute a subset (coarse) again and compare with the kept numbers."),
]
Check = Annotated[
    bool, typer.Option("--check", help="Set every asked figure beside its target, from kept results only.")
]
Keep = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR", help="Gather what is computed into a folder, such as data/studies/finner.", callback=to_folder
    ),
]
Figures = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="Draw the figures of the kept results into a folder.", callback=to_folder),
]
Folder = Annotated[
    Path | None,
    typer.Option("--folder", metavar="DIR", help="Work folder; runs/STUDY if not given.", callback=to_folder),
]
Workers = Annotated[int, typer.Option("--workers", "-w", min=1, help="Pieces computed at a time.")]


@app.command(
    epilog="**Examples:** `indicial study finner --check`, `indicial study finner --compute 'operator-*-coarse-*'`"
)
def study(
    name: Name,
    compute: Compute = None,
    recompute: Recompute = None,
    check: Check = False,
    keep: Keep = None,
    figures: Figures = None,
    folder: Folder = None,
    workers: Workers = 1,
) -> None:
    """A named study: compute its pieces, check its kept results against what was asked of them, draw them.

    An interrupted computation goes on where it was when the same command is given again.
    """
    from indicial.errors import InputError
    from indicial.studies import find_study

    chosen = find_study(name)
    if not (compute or recompute or check or keep or figures):
        raise InputError("nothing to do: give --compute, --recompute, --check, --keep or --figures")
    work = folder if folder is not None else Path("runs") / name
    code = 0
    if compute:
        code |= _compute(chosen, compute, work, workers)
    if keep:
        _keep(chosen, work, keep)
    if recompute:
        code |= _recompute(chosen, recompute, workers)
    if check:
        code |= _check(chosen)
    if figures:
        _figures(chosen, figures)
    if code:
        raise typer.Exit(code)


def _compute(study: Study, pattern: str, work: Path, workers: int) -> int:
    from indicial.cli.console import ConsoleReporter
    from indicial.studies.computing import compute, matching

    pieces = matching(study, pattern)
    try:
        with ConsoleReporter() as reporter:
            failed = compute(study, pieces, work, workers, reporter)
    except KeyboardInterrupt:
        typer.echo(f"\ninterrupted; what is done is kept in {work}: give the same command to go on", err=True)
        raise typer.Exit(130) from None
    typer.echo(f"{len(pieces) - len(failed)} of {len(pieces)} pieces are in {work}")
    for name, reason in failed.items():
        typer.echo(f"FAILED {name}: {reason}")
    return 1 if failed else 0


def _keep(study: Study, work: Path, into: Path) -> None:
    from indicial.studies.kept import Results, keep

    computed = Results.computed(work, study.pieces)
    for path in keep(computed, into):
        typer.echo(f"kept: {path}")


def _recompute(study: Study, subset: str, workers: int) -> int:
    from indicial.cli.console import ConsoleReporter
    from indicial.studies.computing import recompute

    with ConsoleReporter() as reporter:
        drifts = recompute(study, subset, workers, reporter)
    for one in drifts:
        typer.echo(one.summary())
    return 0 if all(one.agrees for one in drifts) else 1


def _check(study: Study) -> int:
    from indicial.studies.claim import summarise
    from indicial.studies.kept import Results

    results = Results.kept(study.name, study.pieces)
    typer.echo(f"{study.title}: {len(results)} of {len(study.pieces)} pieces are kept")
    claims = study.claims(results)
    typer.echo(summarise(claims))
    return 0 if all(claim.holds for claim in claims) else 1


def _figures(study: Study, into: Path) -> None:
    from indicial.studies.kept import Results

    for path in study.draw(Results.kept(study.name, study.pieces), into):
        typer.echo(f"figure: {path}")
