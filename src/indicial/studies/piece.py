"""Pieces of a study: each a computation of minutes at most, kept in one small file with how it was made."""

from __future__ import annotations

import hashlib
import json
import subprocess
from dataclasses import asdict, dataclass, field, fields
from functools import cache
from pathlib import Path
from typing import Any, Self

from indicial import __version__
from indicial.derivatives import Derivative, DerivativeTable
from indicial.errors import InputError
from indicial.files import parse_json, write_text

SCHEMA_VERSION = 1


@dataclass(frozen=True)
class Piece:
    """One computation of a study.

    Parameters
    ----------
    method : str
        Which function of the study computes it.
    mesh : str
        Kind of mesh.
    level : str
        Its fineness.
    mach : float
    settings : dict
        All else that its numbers depend on (plain values).
    """

    method: str
    mesh: str
    level: str
    mach: float
    settings: dict[str, Any] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """What patterns match, such as ``operator-sting-coarse-M1.077``."""
        return f"{self.group}-M{self.mach:.3f}"

    @property
    def group(self) -> str:
        """The kept file that it goes to."""
        return f"{self.method}-{self.mesh}-{self.level}"

    @property
    def key(self) -> str:
        """A digest of the inputs: a result made with others is not taken for this one's."""
        inputs = json.dumps(asdict(self), sort_keys=True)
        return hashlib.sha256(inputs.encode()).hexdigest()[:12]


@dataclass(frozen=True)
class PieceResult:
    """What a piece came to.

    Parameters
    ----------
    piece : Piece
    derivatives : DerivativeTable
    provenance : dict
        Command, version, mesh and its cells, convergence, products with J, times [s] (plain values).
    files : dict
        What is kept beside the numbers, such as histories and flows to be drawn: paths by label.
    """

    piece: Piece
    derivatives: DerivativeTable
    provenance: dict[str, Any]
    files: dict[str, Path] = field(default_factory=dict)

    def file(self, label: str) -> Path:
        """A file kept beside the numbers.

        Raises
        ------
        InputError
            If there is none of that label, or it is gone.
        """
        path = self.files.get(label)
        known = ", ".join(name for name, one in self.files.items() if one.is_file()) or "none"
        if path is None or not path.is_file():
            raise InputError(f"{self.piece.name} has no file {label!r} on disk; there are {known}")
        return path

    def to_dict(self) -> dict[str, Any]:
        """Plain values; what all records share is written once, and files by their names only."""
        files = {"files": {label: path.name for label, path in self.files.items()}} if self.files else {}
        return {"piece": asdict(self.piece), "provenance": self.provenance, **files, **_factored(self.derivatives)}

    @classmethod
    def from_dict(cls, values: dict[str, Any], folder: Path) -> Self:
        """Inverse of `to_dict`, of a result whose files are in `folder`.

        Raises
        ------
        InputError
            If something is missing or bad.
        """
        try:
            records = [{**values["shared"], **record} for record in values["derivatives"]]
            files = {label: folder / name for label, name in values.get("files", {}).items()}
            return cls(Piece(**values["piece"]), DerivativeTable.from_records(records), values["provenance"], files)
        except (KeyError, TypeError) as error:
            raise InputError(f"bad result of a study's piece: {error}") from error


def write_result(result: PieceResult, folder: Path) -> Path:
    """Write a result into the work folder in one step."""
    path = result_path(result.piece, folder)
    write_text(path, json.dumps({"schema_version": SCHEMA_VERSION, **result.to_dict()}, indent=1))
    return path


def read_result(piece: Piece, folder: Path) -> PieceResult | None:
    """The result of a piece from the work folder; None if it is not there."""
    path = result_path(piece, folder)
    if not path.is_file():
        return None
    return PieceResult.from_dict(read_json(path), path.parent)


def result_path(piece: Piece, folder: Path) -> Path:
    """Where the result of a piece is kept in the work folder."""
    return folder / "pieces" / f"{piece.name}-{piece.key}.json"


def file_path(piece: Piece, folder: Path, name: str) -> Path:
    """Where a file of a piece, such as ``alpha.nc``, is kept in the work folder: beside its result."""
    path = result_path(piece, folder)
    return path.with_name(f"{path.stem}.{name}")


def read_json(path: Path) -> dict[str, Any]:
    """A file of this schema.

    Raises
    ------
    InputError
        If it is not one.
    """
    content = parse_json(path)
    if not isinstance(content, dict) or content.get("schema_version") != SCHEMA_VERSION:
        raise InputError(f"{path}: schema_version must be {SCHEMA_VERSION}")
    return content


@cache
def version() -> str:
    """The package's version, and in a checkout the last commit that changed its CFD."""
    cfd = Path(__file__).parents[1] / "cfd"
    commit = _git("log", "-1", "--format=%h", "--abbrev=9", "--", str(cfd))
    if not commit:
        return __version__
    changed = " with changes" if _git("status", "--porcelain", "--", str(cfd)) else ""
    return f"{__version__}, CFD of commit {commit}{changed}"


def _git(*arguments: str) -> str:
    """What git says of the package's checkout; nothing where there is none."""
    command = ["git", "-C", str(Path(__file__).parent), *arguments]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=False, timeout=10.0).stdout.strip()
    except (OSError, subprocess.TimeoutExpired):
        return ""


def _factored(table: DerivativeTable) -> dict[str, Any]:
    """Fields that all records share, and the records with those that differ or are not the default."""
    records = table.to_records()
    defaults = {one.name: one.default for one in fields(Derivative)}
    first = records[0] if records else {}
    shared = {name: value for name, value in first.items() if all(r[name] == value for r in records)}
    own = [{n: v for n, v in r.items() if n not in shared and v != defaults[n]} for r in records]
    return {"shared": shared, "derivatives": own}
