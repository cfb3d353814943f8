"""The commands: each stage by itself, and all of them in order."""

from __future__ import annotations

import enum
from typing import Annotated

import typer

import indicial

app = typer.Typer(
    name="indicial",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    help=(
        "Unsteady aerodynamics for flight dynamics: from a shape to a flown, identified and checked dynamic model.\n\n"
        "**Start here:** `indicial run data/cases/basic_finner_quick.toml`"
    ),
)

Target = Annotated[
    str, typer.Argument(metavar="CASE", help="A case file (on disk or packaged), or the folder of an earlier run.")
]
Output = Annotated[
    str | None, typer.Option("--output", "-o", metavar="DIR", help="Run folder; `runs/NAME` of the case if not given.")
]
Workers = Annotated[
    int | None, typer.Option("--workers", "-w", min=1, help="Processes that share the CFD; the case's if not given.")
]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Log to the terminal what is being done.")]


class Method(enum.StrEnum):
    """Methods of `derive`."""

    MRF = "mrf"
    FOM = "fom"
    IRM = "irm"
    OPERATOR = "operator"
    ALL = "all"


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"indicial {indicial.__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and stop.")
    ] = False,
) -> None:
    pass


def perform(
    target: str, output: str | None, workers: int | None, verbose: bool, stages: tuple[str, ...], resume: bool
) -> None:
    """Run stages of a case or of a run folder, with progress on the terminal."""
    import logging

    from indicial.cli.console import ConsoleReporter
    from indicial.pipeline import open_run, run_stages

    if verbose:
        logging.basicConfig(level=logging.INFO, format="%(asctime)s %(name)s: %(message)s")
    case, folder = open_run(target, output)
    try:
        with ConsoleReporter() as reporter:
            run_stages(case, folder, stages, workers=workers, reporter=reporter, resume=resume)
    except KeyboardInterrupt:
        typer.echo(f"\ninterrupted; what is done is kept in {folder.path}: run the same command to resume", err=True)
        raise typer.Exit(130) from None


@app.command(
    epilog="**Examples:** `indicial run data/cases/basic_finner_quick.toml`, "
    "`indicial run my_missile.toml --output runs/second --workers 8`"
)
def run(case: Target, output: Output = None, workers: Workers = None, verbose: Verbose = False) -> None:
    """Do everything: mesh, CFD by four methods, reduced-order model, flights, identification, comparison, report.

    An interrupted run goes on where it was when the same command is given again.
    """
    from indicial.pipeline import ALL_STAGES, open_run

    perform(case, output, workers, verbose, ALL_STAGES, resume=True)
    folder = open_run(case, output)[1]
    typer.echo((folder.path / "comparison.txt").read_text(encoding="utf-8"))
    typer.echo(f"report: {folder.path / 'report.html'}")


@app.command(epilog="**Example:** `indicial mesh data/cases/basic_finner_quick.toml`")
def mesh(case: Target, output: Output = None, verbose: Verbose = False) -> None:
    """Make and check the meshes of the half and the whole model."""
    perform(case, output, None, verbose, ("mesh",), resume=False)


@app.command(epilog="**Example:** `indicial derive runs/basic_finner_quick --method mrf`")
def derive(
    case: Target,
    method: Annotated[Method, typer.Option("--method", "-m", help="Which of the methods.")] = Method.ALL,
    output: Output = None,
    workers: Workers = None,
    verbose: Verbose = False,
) -> None:
    """Dynamic derivatives from CFD: moving frame (mrf), forced oscillation (fom), indicial response (irm), linearised
    flow (operator).

    CFD results that are already in the run folder are used again.
    """
    stages = tuple(one.value for one in Method if one is not Method.ALL) if method is Method.ALL else (method.value,)
    perform(case, output, workers, verbose, ("mesh", *stages), resume=True)


@app.command(epilog="**Example:** `indicial fly runs/basic_finner_quick`")
def fly(case: Target, output: Output = None, verbose: Verbose = False) -> None:
    """Fly the model twice, with derivatives and with the reduced-order model in the loop; check the damping."""
    perform(case, output, None, verbose, ("fly",), resume=False)


@app.command(epilog="**Example:** `indicial compare runs/basic_finner_quick`")
def compare(case: Target, output: Output = None, verbose: Verbose = False) -> None:
    """Set every derivative by every method beside the measured ones: results.json and a table."""
    from indicial.pipeline import open_run

    perform(case, output, None, verbose, ("compare",), resume=False)
    typer.echo((open_run(case, output)[1].path / "comparison.txt").read_text(encoding="utf-8"))


@app.command(epilog="**Example:** `indicial report runs/basic_finner_quick`")
def report(case: Target, output: Output = None, verbose: Verbose = False) -> None:
    """Draw the figures and write the HTML report, one file that needs nothing else."""
    perform(case, output, None, verbose, ("report",), resume=False)
