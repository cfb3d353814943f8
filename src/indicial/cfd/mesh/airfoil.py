r"""An O-grid about an airfoil with a sharp trailing edge, two-dimensional (one layer of cells).

The Karman-Trefftz map

    (z - z_t) / (z - z_n) = ((w - w_t) / (w - w_n))^n,    n = 2 - epsilon / pi,

with z_t the trailing edge of angle epsilon and z_n midway between the leading edge and the centre of its curvature,
opens the airfoil to a near-circle, without corners, in the w plane. There the mesh is polar about the near-circle's
centre. The map is conformal: in the z plane the grid lines cross at right angles up to the slope of the
near-circle's radius, a few degrees.
Used for such meshes by J. C. Vassberg and A. Jameson, J. Aircraft 47 (2010) 1152.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from indicial.cfd.mesh.geometry import Array
from indicial.cfd.mesh.hexahedra import J_MINUS, J_PLUS, K_MINUS, K_PLUS, PatchSides
from indicial.cfd.mesh.mesh import Mesh
from indicial.cfd.mesh.structured import (
    block_hexahedra,
    block_nodes,
    extrude,
    geometric,
    positive,
    positive_count,
)
from indicial.cfd.shapes.airfoil import Airfoil
from indicial.errors import InputError

Complex = NDArray[np.complex128]


def airfoil_mesh(
    airfoil: Airfoil,
    chord: float = 1.0,
    *,
    n_around: int = 160,
    n_normal: int = 56,
    farfield: float = 40.0,
    wall_aspect: float = 1.0,
    thickness: float = 1.0,
) -> Mesh:
    """O-grid from the airfoil to a near-circle about it; mirror-symmetric to the last bit if the airfoil is.

    Patches: "airfoil" (wall), "farfield", "symmetry" (front and back). Leading edge at the origin, trailing edge at
    (`chord`, 0, 0). Cells are numbered column by column from the wall outwards, the columns from the trailing edge
    along the lower surface round to the upper one. Wall nodes lie on the airfoil to round-off, closest at its edges.

    Parameters
    ----------
    airfoil : Airfoil
        With a closed trailing edge.
    chord : float
        [m].
    n_around : int
        Cells round the airfoil, even, at least 16.
    n_normal : int
        Cells from the wall to the far field.
    farfield : float
        Distance of the outer boundary from the middle of the chord, in chords.
    wall_aspect : float
        Height over length of the cells on the wall.
    thickness : float
        Width of the layer along y, in chords.

    Raises
    ------
    InputError
        If the trailing edge is open, a count or length is out of range, or the first cells leave no room to grow.
    """
    if not airfoil.closed_trailing_edge:
        raise InputError("Airfoil.closed_trailing_edge is False, must be True for an O-grid")
    if positive_count("n_around", n_around) < 16 or n_around % 2:
        raise InputError(f"n_around is {n_around}, must be even and at least 16")
    positive_count("n_normal", n_normal)
    positive("chord", chord)
    positive("wall_aspect", wall_aspect)
    positive("thickness", thickness)
    if not farfield >= 2.0:
        raise InputError(f"farfield is {farfield} chords, must be at least 2")
    z = _plane_nodes(_KarmanTrefftz.of(airfoil), airfoil, n_around, n_normal, farfield, wall_aspect)
    if airfoil.symmetric:
        half = n_around // 2
        z[0].imag = z[half].imag = 0.0
        z[half + 1 :] = np.conj(z[half - 1 :: -1])
    z[-1] = z[0]
    points = chord * extrude(z.real, z.imag, thickness)
    cells = block_hexahedra(block_nodes(*points.shape[:3]))
    number = block_nodes(*cells.shape[:3])
    patches = [
        PatchSides.of("airfoil", "wall", (number[..., 0], K_MINUS)),
        PatchSides.of("farfield", "farfield", (number[..., -1], K_PLUS)),
        PatchSides.of("symmetry", "symmetry", (number, J_MINUS), (number, J_PLUS)),
    ]
    return Mesh.from_hexahedra(points.reshape(-1, 3), cells.reshape(-1, 8), patches)


@dataclass(frozen=True)
class _KarmanTrefftz:
    """The map between the airfoil's plane z = x + i z and the near-circle's plane w."""

    z_tail: complex
    z_nose: complex
    power: float

    @classmethod
    def of(cls, airfoil: Airfoil) -> _KarmanTrefftz:
        slope = float(airfoil.camber_line(0.0)[1])
        inside = 0.5 * airfoil.nose_radius * (1.0 + 1j * slope) / abs(1.0 + 1j * slope)
        return cls(1.0 + 0.0j, inside, 2.0 - airfoil.trailing_edge_angle / np.pi)

    @property
    def w_tail(self) -> complex:
        """Image of the trailing edge, with that of the nose point at 0 and ``dz/dw = 1`` far away."""
        return (self.z_tail - self.z_nose) / self.power

    def to_circle(self, z: Complex, turns: Array) -> Complex:
        """w of contour points z; `turns` is the argument of z - z_nose, growing from 0 to 2 pi along the contour."""
        tail, nose = z - self.z_tail, z - self.z_nose
        argument = np.angle(tail) % (2.0 * np.pi) - turns
        size = np.abs(tail) / np.abs(nose)
        q = size ** (1.0 / self.power) * np.exp(1j * argument / self.power)
        return np.asarray(self.w_tail / (1.0 - q))

    def from_circle(self, w: Complex) -> Complex:
        """z of points w outside the near-circle."""
        ratio = (w - self.w_tail) / w
        q = np.abs(ratio) ** self.power * np.exp(1j * self.power * np.angle(ratio))
        return np.asarray((self.z_tail - q * self.z_nose) / (1.0 - q))


def _contour(airfoil: Airfoil, map_: _KarmanTrefftz, t: Array) -> Complex:
    """w of the airfoil's points at the parameter t in [0, 2 pi]: x = cos^2(t/2), upper surface first."""
    x = np.cos(0.5 * t) ** 2
    upper = t <= np.pi
    surface = np.where(upper[:, None], airfoil.surface(x, 1.0), airfoil.surface(x, -1.0))
    z = surface[:, 0] + 1j * surface[:, 1]
    turns = np.angle(z - map_.z_nose)
    turns = np.where(upper & (turns < -0.5 * np.pi), turns + 2.0 * np.pi, turns)
    turns = np.where(~upper & (turns < 0.5 * np.pi), turns + 2.0 * np.pi, turns)
    return map_.to_circle(z, turns)


def _plane_nodes(
    map_: _KarmanTrefftz, airfoil: Airfoil, n_around: int, n_normal: int, farfield: float, wall_aspect: float
) -> Complex:
    """Nodes (n_around + 1, n_normal + 1) in the z plane, clockwise from the trailing edge, wall first."""
    dense = _contour(airfoil, map_, np.linspace(0.0, 2.0 * np.pi, 2001)[1:-1])
    centre = complex(dense.mean())
    if airfoil.symmetric:
        centre = complex(centre.real)
    start = float(np.angle(map_.w_tail - centre))

    def azimuth(t: Array) -> Array:
        """Angle round the near-circle from the trailing edge, growing with t from 0 to 2 pi."""
        angle = (np.angle(_contour(airfoil, map_, t) - centre) - start) % (2.0 * np.pi)
        return np.where(t < 0.5, (angle + np.pi) % (2.0 * np.pi) - np.pi, angle)

    wanted = np.linspace(2.0 * np.pi, 0.0, n_around + 1)
    low, high = np.zeros(n_around - 1), np.full(n_around - 1, 2.0 * np.pi)
    for _ in range(52):  # bisection to the last bit
        middle = 0.5 * (low + high)
        below = azimuth(middle) < wanted[1:-1]
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    wall = np.concatenate([[map_.w_tail], _contour(airfoil, map_, 0.5 * (low + high)), [map_.w_tail]])
    radius = np.abs(wall - centre)
    depth = np.log(farfield / radius)
    first = wall_aspect * 2.0 * np.pi / n_around
    if first * n_normal > depth.min():
        raise InputError(
            f"{n_normal} cells of aspect {wall_aspect} on the wall overfill {farfield} chords: "
            "take fewer along the normal, more around, or a smaller wall_aspect"
        )
    fractions = geometric(first, float(depth.mean()), n_normal) / float(depth.mean())
    direction = np.exp(1j * (start + wanted))
    w = centre + direction[:, None] * radius[:, None] * np.exp(depth[:, None] * fractions)
    w[:, 0] = wall
    return map_.from_circle(w)
