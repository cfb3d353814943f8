"""A box of hexahedra, straight or skewed, for still air, orders of accuracy and other tests."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, get_args

import numpy as np

from indicial.cfd.mesh.geometry import Array
from indicial.cfd.mesh.hexahedra import PatchSides
from indicial.cfd.mesh.mesh import Mesh, PatchKind
from indicial.cfd.mesh.structured import block_hexahedra, block_nodes, positive_count
from indicial.errors import InputError

Skew = Literal["none", "smooth", "random"]
Side = Literal["x_min", "x_max", "y_min", "y_max", "z_min", "z_max"]
SIDES: tuple[Side, ...] = get_args(Side)


def box_mesh(
    shape: tuple[int, int, int],
    lower: tuple[float, float, float] = (0.0, 0.0, 0.0),
    upper: tuple[float, float, float] = (1.0, 1.0, 1.0),
    *,
    kinds: PatchKind | Mapping[Side, PatchKind] = "farfield",
    skew: Skew = "none",
    amplitude: float = 0.2,
    seed: int = 0,
) -> Mesh:
    """Box of ``nx ny nz`` cells with one patch per side: x_min, x_max, y_min, y_max, z_min, z_max.

    Parameters
    ----------
    shape : (nx, ny, nz)
        Cells along each axis; ``ny = 1`` is a two-dimensional mesh, whose nodes are then skewed in x and z only.
    lower, upper : (x, y, z)
        Opposite corners [m].
    kinds : kind or mapping from side to kind
        One kind for all sides, or a mapping; sides not in it are "farfield".
    skew : {"none", "smooth", "random"}
        "smooth" moves interior nodes along a sine (the same map at every refinement), "random" by independent
        amounts; the box itself stays exact, and both leave the faces warped in 3-D.
    amplitude : float
        Largest displacement: in cells for "random" (positive cells up to about 0.25), and for "smooth" as the
        largest stretch ``pi * displacement / side`` of the map (below about 0.4).
    seed : int
        Of the random displacement.

    Raises
    ------
    InputError
        On a bad size, side, kind or skew.
    """
    for name, n in zip(("nx", "ny", "nz"), shape, strict=True):
        positive_count(name, n)
    if not all(a < b for a, b in zip(lower, upper, strict=True)):
        raise InputError(f"box from {lower} to {upper}: each lower corner must be below the upper")
    if skew not in get_args(Skew):
        raise InputError(f"skew is {skew!r}, must be one of {', '.join(get_args(Skew))}")
    side_kinds: dict[Side, PatchKind] = dict.fromkeys(SIDES, "farfield")
    if isinstance(kinds, str):
        side_kinds = dict.fromkeys(SIDES, kinds)
    else:
        unknown = set(kinds) - set(SIDES)
        if unknown:
            raise InputError(f"kinds names the side {sorted(unknown)[0]!r}, must be one of {', '.join(SIDES)}")
        side_kinds.update(kinds)
    unit = np.stack(np.meshgrid(*(np.linspace(0.0, 1.0, n + 1) for n in shape), indexing="ij"), axis=-1)
    if skew != "none":
        unit += _displacement(unit, shape, skew, amplitude, seed)
    points = np.asarray(lower) + unit * (np.asarray(upper) - np.asarray(lower))
    cells = block_hexahedra(block_nodes(*(n + 1 for n in shape)))
    number = block_nodes(*shape)
    layers = (number[0], number[-1], number[:, 0], number[:, -1], number[:, :, 0], number[:, :, -1])
    patches = [PatchSides.of(name, side_kinds[name], (layers[i], i)) for i, name in enumerate(SIDES)]
    return Mesh.from_hexahedra(points.reshape(-1, 3), cells.reshape(-1, 8), patches)


def _displacement(unit: Array, shape: tuple[int, int, int], skew: Skew, amplitude: float, seed: int) -> Array:
    """Displacement of the nodes of the unit box, zero on its sides; not along y in one layer."""
    thick = [axis for axis in range(3) if axis != 1 or shape[1] > 1]
    bump = np.prod([np.sin(np.pi * unit[..., axis]) for axis in thick], axis=0)
    move = np.zeros_like(unit)
    if skew == "smooth":
        for axis in thick:
            other = unit[..., thick[(thick.index(axis) + 1) % len(thick)]]
            move[..., axis] = amplitude / np.pi * bump * np.cos(np.pi * other)
        return move
    inside = tuple(slice(1, -1) if axis in thick else slice(None) for axis in range(3))
    random = np.random.default_rng(seed).uniform(-amplitude, amplitude, unit.shape) / np.asarray(shape)
    if shape[1] == 1:
        random[:, 1] = random[:, 0]
        random[..., 1] = 0.0
    move[inside] = random[inside]
    return move
