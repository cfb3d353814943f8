"""Pieces that the structured generators share: hexahedra of a block, and spacings."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from indicial.cfd.mesh.geometry import Array, Index
from indicial.errors import InputError


def block_nodes(*shape: int) -> Index:
    """Node numbers of a block of ``ni nj nk`` nodes, in C order."""
    return np.arange(np.prod(shape), dtype=np.int64).reshape(shape)


def block_hexahedra(nodes: Index) -> Index:
    """Hexahedra (ni-1, nj-1, nk-1, 8) of a block whose nodes have the numbers (ni, nj, nk).

    ``cells.reshape(-1, 8)`` numbers cells with i slowest and k fastest.
    """
    lower, upper = nodes[:, :, :-1], nodes[:, :, 1:]

    def corners(layer: Index) -> list[Index]:
        return [layer[:-1, :-1], layer[1:, :-1], layer[1:, 1:], layer[:-1, 1:]]

    return np.stack(corners(lower) + corners(upper), axis=-1)


def extrude(x: Array, z: Array, thickness: float) -> Array:
    """Nodes of one layer of cells, (ni, 2, nk, 3), from plane nodes x, z of shape (ni, nk): y = 0 and `thickness`."""
    points = np.empty((x.shape[0], 2, x.shape[1], 3))
    points[..., 0], points[..., 2] = x[:, None, :], z[:, None, :]
    points[:, 0, :, 1], points[:, 1, :, 1] = 0.0, thickness
    return points


def geometric(first: float, length: float, n: int) -> Array:
    """`n` + 1 stations from 0 to `length` whose steps grow by a constant ratio from about `first`.

    The first step is exactly `first` (a ratio below one if the steps must shrink).
    """
    if n < 1 or not 0.0 < first <= length:
        raise InputError(f"cannot place {n} cells on {length} m with a first step of {first} m")
    if n == 1:
        return np.array([0.0, length])
    powers = np.arange(n)
    ratio = brentq(lambda log_q: first * np.exp(powers * log_q).sum() - length, -60.0 / n, np.log(length / first) + 1.0)
    steps = first * np.exp(powers * ratio)
    stations = np.concatenate([[0.0], np.cumsum(steps)])
    stations[-1] = length
    return stations


def two_sided(first: float, last: float, n: int) -> Array:
    """`n` + 1 stations from 0 to 1 with a first step near `first` and a last step near `last` (Vinokur's tanh).

    Source: M. Vinokur, J. Comput. Phys. 50 (1983) 215, for end steps in units of the length.
    """
    if n < 1:
        raise InputError(f"number of cells is {n}, must be at least 1")
    xi = np.linspace(0.0, 1.0, n + 1)
    skew = np.sqrt(last / first)
    stretch = 1.0 / (n * np.sqrt(first * last))
    if stretch > 1.0 + 1e-6:
        d = brentq(lambda v: np.sinh(v) / v - stretch, 1e-6, 200.0)
        u = 0.5 * (1.0 + np.tanh(d * (xi - 0.5)) / np.tanh(d / 2.0))
    elif stretch < 1.0 - 1e-6:
        d = brentq(lambda v: np.sin(v) / v - stretch, 1e-6, np.pi - 1e-9)
        u = 0.5 * (1.0 + np.tan(d * (xi - 0.5)) / np.tan(d / 2.0))
    else:
        u = xi
    stations: Array = u / (skew + (1.0 - skew) * u)
    stations[0], stations[-1] = 0.0, 1.0
    return stations


def positive_count(name: str, value: int) -> int:
    """`value` if it is a positive whole number, else an InputError naming it."""
    if int(value) != value or value < 1:
        raise InputError(f"{name} is {value}, must be a positive whole number")
    return int(value)


def positive(name: str, value: float) -> float:
    """`value` if it is positive and finite, else an InputError naming it."""
    if not (np.isfinite(value) and value > 0.0):
        raise InputError(f"{name} is {value}, must be positive and finite")
    return float(value)
