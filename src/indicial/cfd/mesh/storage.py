"""Meshes in numpy archives."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import numpy as np

from indicial.cfd.mesh.mesh import Mesh, Patch
from indicial.errors import InputError
from indicial.files import atomic_path

SCHEMA_VERSION = 1
_ARRAYS = ("points", "face_offsets", "face_points", "owner", "neighbour")


def save_mesh(mesh: Mesh, path: str | Path) -> None:
    """Write `mesh` to an ``.npz`` archive in one step: its arrays, its patches and the schema version."""
    patches = [[p.name, p.kind, p.start, p.stop] for p in mesh.patches]
    header = json.dumps({"schema": "indicial.mesh", "schema_version": SCHEMA_VERSION, "patches": patches})
    with atomic_path(path) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(stream, header=np.array(header), **{name: getattr(mesh, name) for name in _ARRAYS})


def load_mesh(path: str | Path) -> Mesh:
    """Read a mesh that `save_mesh` wrote.

    Raises
    ------
    InputError
        If the file is missing, is not a mesh, or has another schema version.
    """
    try:
        with np.load(path, allow_pickle=False) as archive:
            header = json.loads(str(archive["header"]))
            arrays = {name: archive[name] for name in _ARRAYS}
    except FileNotFoundError:
        raise InputError(f"mesh file {path} does not exist") from None
    except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise InputError(f"mesh file {path} cannot be read as a mesh: {error}") from error
    if header.get("schema") != "indicial.mesh" or header.get("schema_version") != SCHEMA_VERSION:
        raise InputError(
            f"mesh file {path} has schema {header.get('schema')} version {header.get('schema_version')}, "
            f"must be indicial.mesh version {SCHEMA_VERSION}"
        )
    return Mesh(**arrays, patches=tuple(Patch(*entry) for entry in header["patches"]))
