"""Kept results of a study: in the package's data, and in a work folder beside it."""

from __future__ import annotations

import json
import shutil
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Self

import numpy as np

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.files import atomic_path, write_text
from indicial.reference_data import data_folder
from indicial.studies.piece import SCHEMA_VERSION, Piece, PieceResult, read_json, read_result


@dataclass(frozen=True)
class Results:
    """Results of pieces.

    Parameters
    ----------
    results : tuple of PieceResult
    """

    results: tuple[PieceResult, ...]

    def __iter__(self) -> Iterator[PieceResult]:
        return iter(self.results)

    def __len__(self) -> int:
        return len(self.results)

    def __add__(self, other: Iterable[PieceResult]) -> Results:
        return Results(self.results + tuple(other))

    def select(self, **wanted: object) -> Results:
        """Results whose piece has these fields: ``select(method="operator", level="coarse")``."""
        return Results(
            tuple(r for r in self.results if all(getattr(r.piece, name) == value for name, value in wanted.items()))
        )

    def at(self, mach: float) -> PieceResult | None:
        """The single result at a Mach number, None if there is none.

        Raises
        ------
        InputError
            If there is more than one.
        """
        found = [r for r in self.results if abs(r.piece.mach - mach) < 1e-9]
        if len(found) > 1:
            raise InputError(f"{len(found)} results at M {mach:g}, one is needed")
        return found[0] if found else None

    def by_name(self) -> dict[str, PieceResult]:
        """Results by the names of their pieces."""
        return {r.piece.name: r for r in self.results}

    def machs(self) -> Array:
        """Mach numbers, increasing, shape (n,)."""
        return np.array(sorted({r.piece.mach for r in self.results}))

    def series(self, name: str, **wanted: object) -> tuple[Array, Array]:
        """Mach numbers and values of one derivative over them, shape (n,) each; `wanted` picks the record."""
        pairs = []
        for mach in self.machs():
            result = self.at(float(mach))
            assert result is not None
            found = result.derivatives.select(name=name, **wanted).records
            if len(found) > 1:
                raise InputError(f"{len(found)} records of {name} in {result.piece.name}, one is needed")
            pairs += [(result.piece.mach, record.value) for record in found]
        both = np.array(pairs).reshape(-1, 2)
        return both[:, 0], both[:, 1]

    @classmethod
    def kept(cls, study: str, pieces: Sequence[Piece]) -> Self:
        """Those of `pieces` that travel with the package."""
        folder = data_folder() / "studies" / study
        wanted = {piece.key for piece in pieces}
        found = [r for file in _files(folder) for r in _read_group(Path(str(file))) if r.piece.key in wanted]
        return cls(tuple(found))

    @classmethod
    def computed(cls, folder: Path, pieces: Sequence[Piece]) -> Self:
        """Those of `pieces` that are in a work folder."""
        return cls(tuple(r for piece in pieces if (r := read_result(piece, folder)) is not None))


def keep(results: Results, folder: Path) -> tuple[Path, ...]:
    """Add results to a folder of kept ones, one file for each group; those of the same piece are replaced.

    What lies beside the numbers is copied, under names without the key: the same piece replaces it too.
    """
    groups: dict[str, dict[str, PieceResult]] = defaultdict(dict)
    for result in results:
        groups[result.piece.group][result.piece.name] = _with_files(result, folder)
    paths = []
    for group, found in groups.items():
        path = folder / f"{group}.json"
        before = {r.piece.name: r for r in _read_group(path)} if path.is_file() else {}
        ordered = sorted((before | found).values(), key=lambda r: r.piece.mach)
        write_text(path, _group_text(ordered))
        paths.append(path)
    return tuple(paths)


def _with_files(result: PieceResult, folder: Path) -> PieceResult:
    """The result with its files copied into a folder."""
    copies = {}
    for label in result.files:
        source = result.file(label)
        copies[label] = folder / f"{result.piece.name}.{label}{source.suffix}"
        with atomic_path(copies[label]) as temporary:
            shutil.copyfile(source, temporary)
    return replace(result, files=copies)


def _files(folder: Traversable) -> list[Traversable]:
    if not folder.is_dir():
        return []
    return sorted((file for file in folder.iterdir() if file.name.endswith(".json")), key=lambda file: file.name)


def _read_group(path: Path) -> list[PieceResult]:
    return [PieceResult.from_dict(values, path.parent) for values in read_json(path)["results"]]


def _group_text(results: Sequence[PieceResult]) -> str:
    """JSON with one derivative a line: small, and changes show line by line."""
    blocks = []
    for result in results:
        values = result.to_dict()
        records = ",\n   ".join(json.dumps(record) for record in values.pop("derivatives"))
        head = ",\n  ".join(f"{json.dumps(name)}: {json.dumps(value)}" for name, value in values.items())
        blocks.append(f' {{\n  {head},\n  "derivatives": [\n   {records}\n  ]\n }}')
    body = ",\n".join(blocks)
    return f'{{\n"schema_version": {SCHEMA_VERSION},\n"results": [\n{body}\n]\n}}\n'
