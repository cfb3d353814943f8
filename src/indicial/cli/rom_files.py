"""`rom build` and `rom check`: models from the histories of any code, and against them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from indicial.cli.outputs import to_file, to_folder
from indicial.cli.rom import rom

if TYPE_CHECKING:
    from indicial.history import History

Map = Annotated[
    Path | None,
    typer.Option(
        "--map", "-m", metavar="MAP", help="What the files do not say: condition, units, axes, columns, motion (TOML)."
    ),
]


@rom.command(
    epilog="**Examples:** `indicial rom build --map examples/fluent_plate/map.toml`, "
    "`indicial rom build alpha_step-rfile.out q_step-rfile.out --map map.toml -o runs/missile`, "
    "`indicial rom build runs/basic_finner_quick/histories/irm_alpha.nc runs/basic_finner_quick/histories/irm_q.nc`"
)
def build(
    files: Annotated[
        list[Path] | None,
        typer.Argument(metavar="FILE", help="Histories: one for each that the map describes, in its order."),
    ] = None,
    map_file: Map = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="DIR", help="Where to write; `runs/NAME` if not given.", callback=to_folder
        ),
    ] = None,
    compare: Annotated[
        bool,
        typer.Option("--compare", help="Make all other realisations too, judged by the motions that are no steps."),
    ] = False,
    max_order: Annotated[int, typer.Option(min=1, max=12, help="Most poles for each input.")] = 6,
) -> None:
    """Derivatives, a state-space model and plots from the force histories of any code.

    The model is made from the steps and predicts all other histories, which it has not seen; without steps it is
    identified from the motions there are.

    Own histories (`.nc`) need no map. All others do: Fluent report files (`.out`), SU2 `history.csv`, OpenFOAM
    `postProcessing/NAME` folders, tables with column names. `docs/histories.md` has every key of a map.
    """
    from indicial.errors import InputError
    from indicial.rom import build_model

    histories, outputs = _histories(files or [], map_file)
    built = build_model(histories, outputs, max_order=max_order, side_by_side=compare)
    typer.echo(built.summary())
    _oscillations(histories)
    name = map_file.stem if map_file is not None else histories[0].motion.get("kind", "model")
    if map_file is not None and name == "map":
        name = map_file.resolve().parent.name
    into = output if output is not None else Path("runs") / str(name)
    if into.is_file():
        raise InputError(f"{into} is a file; --output must name a folder")
    for i, history in enumerate(histories):
        history.to_netcdf(into / "histories" / f"{i + 1}_{history.motion.get('kind', 'motion')}.nc")
    for path in built.write(into):
        typer.echo(f"written: {path}")


@rom.command(
    epilog="**Example:** `indicial rom check runs/fluent_plate/model.json flight.csv --map flight.toml -o check.png`"
)
def check(
    model: Annotated[Path, typer.Argument(metavar="MODEL", help="A model's file, `.json` or `.nc`.")],
    files: Annotated[list[Path], typer.Argument(metavar="HISTORY...", help="Histories that the model has not seen.")],
    map_file: Map = None,
    since: Annotated[float, typer.Option(help="Reduced time 2Vt/c from which to compare.")] = 0.0,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="PNG", help="Draw them; with several, numbered.", callback=to_file),
    ] = None,
) -> None:
    """A model's prediction beside histories it has not seen, in words and in a figure."""
    from indicial.files import atomic_path
    from indicial.rom import check_prediction
    from indicial.rom.export import read_model

    known = read_model(model)
    histories, _ = _histories(files, map_file)
    for i, history in enumerate(histories):
        checked = check_prediction(known, history, since=since)
        typer.echo(checked.summary())
        if output is not None:
            path = output if len(histories) == 1 else output.with_stem(f"{output.stem}_{i + 1}")
            with atomic_path(path) as temporary:
                checked.plot().savefig(temporary, dpi=120)
            typer.echo(f"written: {path}")


def _histories(files: list[Path], map_file: Path | None) -> tuple[list[History], tuple[str, ...]]:
    """Histories, with what was found in reading them on the terminal, and the coefficients that all of them tell."""
    from indicial.errors import InputError
    from indicial.history import History
    from indicial.readers import read_histories

    if map_file is None:
        foreign = [path for path in files if path.suffix != ".nc"]
        if foreign or not files:
            raise InputError(f"{foreign[0]}: needs --map" if foreign else "give histories (.nc), or a --map")
        return [History.from_netcdf(path) for path in files], ("CN", "Cm")
    readings = read_histories(map_file, files)
    for reading in readings:
        typer.echo(reading.summary(), err=True)
    outputs = tuple(name for name in readings[0].outputs if all(name in one.outputs for one in readings))
    if not outputs:
        raise InputError(f"{map_file}: the histories have no coefficient in common")
    return [reading.history for reading in readings], outputs


def _oscillations(histories: list[History]) -> None:
    """What each forced oscillation says by itself, Eq. (12)."""
    from indicial.errors import InputError
    from indicial.methods import forced_oscillation

    for history in histories:
        if history.motion.get("kind") not in forced_oscillation.KINDS:
            continue
        try:
            typer.echo(f"\nforced oscillation by itself\n{forced_oscillation.fourier(history).summary()}")
        except InputError as error:
            typer.echo(f"\nforced oscillation by itself: {error}")
