"""The folder of a run: what each stage left there, and whether it still belongs to the case."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from indicial import __version__
from indicial.case import Case, parse_case
from indicial.errors import InputError
from indicial.files import why, write_text

CASE_FILE = "case.toml"
_METHODS = ("mrf", "fom", "irm", "operator")


@dataclass(frozen=True)
class RunFolder:
    """Paths and stage records of one run.

    Every stage writes ``STAGE.json``: its results as plain values, with the key of all that they depend on.

    Parameters
    ----------
    path : Path
    case_text : str, optional
        The case file that is to be kept beside the results, if it is not there already.
    """

    path: Path
    case_text: str | None = None

    @property
    def experiments(self) -> Path:
        """Kept CFD results."""
        return self.path / "experiments"

    @property
    def states(self) -> Path:
        """Flow states and checkpoints, from which an interrupted run goes on."""
        return self.path / "states"

    @property
    def histories(self) -> Path:
        """Load histories and flights, netCDF."""
        return self.path / "histories"

    @property
    def figures(self) -> Path:
        """Figures, PNG."""
        return self.path / "figures"

    @property
    def frequency_response(self) -> Path:
        """H(ik) of the linearised flow, netCDF."""
        return self.histories / "frequency_response.nc"

    @property
    def projected_model(self) -> Path:
        """The model projected from the linearised flow, JSON, beside the one made of step responses."""
        return self.path / "rom" / "projected.json"

    def mesh(self, whole: bool) -> Path:
        """The mesh of the whole model or of its half."""
        return self.path / "mesh" / ("whole.npz" if whole else "half.npz")

    def keep_case(self) -> None:
        """Keep the case file beside its results."""
        if self.case_text is not None:
            write_text(self.path / CASE_FILE, self.case_text)

    def read(self, stage: str) -> dict[str, Any]:
        """The results of a stage.

        Raises
        ------
        InputError
            If the stage has not been run, or its file cannot be read.
        """
        path = self.path / f"{stage}.json"
        if not path.is_file():
            command = f"derive --method {stage}" if stage in _METHODS else stage
            raise InputError(f"{path}: not there yet; run `indicial {command}` first, or all with `indicial run`")
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise InputError(f"{path}: not a readable stage record ({error}); delete it and run again") from error
        if not isinstance(content, dict) or "key" not in content:
            raise InputError(f"{path}: not a stage record; delete it and run again")
        return content

    def write(self, stage: str, key: str, seconds: float, results: dict[str, Any]) -> None:
        """Keep the results of a stage, in one step."""
        record = {"stage": stage, "key": key, "version": __version__, "seconds": round(seconds, 3), **results}
        write_text(self.path / f"{stage}.json", json.dumps(record, indent=1))

    def is_fresh(self, stage: str, key: str) -> bool:
        """Whether the kept results of a stage have this key."""
        try:
            return bool(self.read(stage)["key"] == key)
        except InputError:
            return False

    def forget(self, stage: str) -> None:
        """Remove the record of a stage: its results no longer count."""
        (self.path / f"{stage}.json").unlink(missing_ok=True)


def open_run(target: str | Path, output: str | Path | None = None) -> tuple[Case, RunFolder]:
    """The case and folder that a user names: a case file, or the folder of an earlier run. Nothing is written.

    Parameters
    ----------
    target : path
        A case file (on disk, or packaged), or a run folder.
    output : path, optional
        The run folder of a case file; ``runs/NAME`` if not given.

    Raises
    ------
    InputError
        If neither is there, or the case is wrong.
    """
    from indicial.reference_data import find_case

    if not str(target).strip():
        raise InputError("no case is named; give a case file or the folder of an earlier run")
    given = Path(target)
    if given.is_dir():
        if output is not None and Path(output).resolve() != given.resolve():
            raise InputError(f"{target} is a run folder: --output {output} would be another; give only one")
        file = given / CASE_FILE
        if not file.is_file():
            raise InputError(f"{target}: not a run folder, there is no {CASE_FILE} in it; give a case file")
        return parse_case(_read(file), str(file)), RunFolder(given)
    file = find_case(given)
    text = _read(file)
    case = parse_case(text, str(target))
    folder = RunFolder(Path(output) if output is not None else Path("runs") / file.stem, text)
    if folder.path.exists() and not folder.path.is_dir():
        raise InputError(f"{folder.path}: is a file; --output must name a folder")
    return case, folder


def _read(file: Path) -> str:
    try:
        return file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{file}: cannot be read ({why(error)})") from error


def digest(*parts: Any) -> str:
    """A key for plain values, the same on every machine."""
    text = json.dumps([__version__, *parts], sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()
