"""The `rom` commands: the stage of a run, and what is done with model files."""

from __future__ import annotations

import difflib
import enum
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from indicial.cli.commands import Output, Target, Verbose, app, perform
from indicial.cli.outputs import to_file


class StageOrCommand(TyperGroup):
    """A group whose arguments are those of its command `stage` when they do not begin with a command's name."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Put `stage` where no command is named, and refuse what is nearly a command's name."""
        if args[:1] != ["--help"] and (not args or args[0] not in self.commands):
            self._refuse_misspelt(ctx, args)
            args = ["stage", *args]
        return super().parse_args(ctx, args)

    def _refuse_misspelt(self, ctx: Any, args: list[str]) -> None:
        """A case would be called so only if it were there."""
        shown = [name for name in self.commands if name != "stage"]
        near = difflib.get_close_matches(args[0], shown, n=1) if args else []
        if near and not Path(args[0]).exists():
            ctx.fail(f"No such command '{args[0]}'. Did you mean '{near[0]}'?")


rom = typer.Typer(
    cls=StageOrCommand,
    help=(
        "Reduced-order models. With a case or a run folder: its stage `rom`, a state-space model from the step "
        "responses, checked against the forced oscillations it has not seen."
    ),
    epilog="**Examples:** `indicial rom runs/basic_finner_quick`, "
    "`indicial rom build alpha_step.out q_step.out --map map.toml`, "
    "`indicial rom check model.json flight.csv --map map.toml`, "
    "`indicial rom export model.json --to fmu -o model.fmu`",
    rich_markup_mode="markdown",
)
app.add_typer(rom, name="rom")


class Format(enum.StrEnum):
    """Formats of `export`."""

    JSON = "json"
    NETCDF = "netcdf"
    MAT = "mat"
    C = "c"
    FMU = "fmu"
    JSBSIM = "jsbsim"


@rom.command(hidden=True, epilog="**Example:** `indicial rom runs/basic_finner_quick`")
def stage(case: Target, output: Output = None, verbose: Verbose = False) -> None:
    """A state-space model from the step responses, checked against the forced oscillations it has not seen."""
    perform(case, output, None, verbose, ("rom",), resume=False)


@rom.command(epilog="**Example:** `indicial rom export runs/basic_finner_quick/rom/model.json --to fmu -o finner.fmu`")
def export(
    model: Annotated[Path, typer.Argument(metavar="MODEL", help="A model's file, `.json` or `.nc`.")],
    to: Annotated[Format, typer.Option("--to", help="For which program.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="The file to write.", callback=to_file)
    ],
    sources_only: Annotated[
        bool, typer.Option("--sources-only", help="Do not compile an FMU: whoever imports it does.")
    ] = False,
) -> None:
    """Write a model for another program: MATLAB, C, an FMU, JSBSim, or the package's own files."""
    from indicial.errors import InputError
    from indicial.rom.export import export as write
    from indicial.rom.export import export_fmu, read_model

    if sources_only and to is not Format.FMU:
        raise InputError("--sources-only is for --to fmu")
    read = read_model(model)
    files = export_fmu(read, output, sources_only=True) if sources_only else write(read, to.value, output)
    typer.echo(read.summary())
    for path in files:
        typer.echo(f"written: {path}")
