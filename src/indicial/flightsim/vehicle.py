"""A rigid vehicle: mass, inertia, centre of gravity and reference quantities."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from indicial.conventions import Array, ReferenceQuantities
from indicial.errors import InputError
from indicial.flightsim.expressions import free_symbols, is_number


@dataclass(frozen=True)
class Vehicle:
    """A rigid body that flies.

    Mass, inertia and centre of gravity may be casadi expressions: of `TIME` for a vehicle that burns, of symbols for
    one whose masses are varied. Mass that leaves does so without being thrown; a `Motor` throws it.

    Parameters
    ----------
    name : str
    mass : float or casadi expression
        m [kg].
    inertia : ndarray or casadi expression
        Inertia tensor about the centre of gravity [kg m^2], body axes (x forward, y right, z down), shape (3, 3);
        off-diagonal elements are minus the products of inertia.
    reference : ReferenceQuantities
        What this vehicle's loads are made dimensionless with. An aerodynamic model may be given about another
        moment reference point, not with another length or area.
    centre_of_gravity : tuple of float
        Mesh axes [m]: (x, y, z) from the nose, x aft.

    Raises
    ------
    InputError
        If the mass is not positive or the inertia is not that of a body.
    """

    name: str
    mass: Any
    inertia: Any
    reference: ReferenceQuantities
    centre_of_gravity: tuple[Any, Any, Any]

    def __post_init__(self) -> None:
        if is_number(self.mass) and not (math.isfinite(self.mass) and self.mass > 0.0):
            raise InputError(f"mass of {self.name} is {self.mass} kg, must be positive and finite")
        if isinstance(self.inertia, ca.SX):
            if self.inertia.shape != (3, 3):
                raise InputError(f"inertia of {self.name} must be of shape (3, 3), not {self.inertia.shape}")
            return
        tensor = np.array(self.inertia, dtype=float)
        if tensor.shape != (3, 3) or not np.all(np.isfinite(tensor)):
            raise InputError(f"inertia of {self.name} must be a finite tensor of shape (3, 3), not {tensor.shape}")
        if not np.allclose(tensor, tensor.T, rtol=1e-12, atol=0.0):
            raise InputError(f"inertia of {self.name} must be symmetric")
        principal = np.linalg.eigvalsh(tensor)
        if principal[0] <= 0.0 or principal[2] > (principal[0] + principal[1]) * (1.0 + 1e-9):
            raise InputError(
                f"principal moments of inertia of {self.name} are {principal} kg m^2: each must be positive and none "
                "more than the sum of the other two"
            )
        tensor.setflags(write=False)
        object.__setattr__(self, "inertia", tensor)

    @property
    def parameters(self) -> tuple[Any, ...]:
        """Free casadi symbols of mass, inertia and centre of gravity."""
        return free_symbols((self.mass, self.inertia, *self.centre_of_gravity))

    def arm_to(self, point: tuple[float, float, float]) -> Any:
        """From the centre of gravity to `point` (mesh axes [m]), in body axes [m], casadi shape (3, 1)."""
        aft, right, up = (ca.SX(p) - c for p, c in zip(point, self.centre_of_gravity, strict=True))
        return ca.vertcat(-aft, right, -up)

    def summary(self) -> str:
        """Mass properties in two lines."""
        if isinstance(self.inertia, ca.SX) or not all(is_number(v) for v in (self.mass, *self.centre_of_gravity)):
            names = ", ".join(symbol.name() for symbol in self.parameters) or "TIME"
            return f"{self.name}: mass properties that depend on {names}"
        ix, iy, iz = np.diag(self.inertia)
        x, y, z = self.centre_of_gravity
        return (
            f"{self.name}: m = {self.mass:g} kg, Ix, Iy, Iz = {ix:g}, {iy:g}, {iz:g} kg m^2\n"
            f"  centre of gravity at ({x:g}, {y:g}, {z:g}) m, c = {self.reference.length:g} m, "
            f"S = {self.reference.area:g} m^2"
        )


def axisymmetric_inertia(axial: float, transverse: float) -> Array:
    """Inertia tensor [kg m^2] of a body of rotational symmetry about x, shape (3, 3)."""
    return np.diag([axial, transverse, transverse])


def basic_finner_range_model() -> Vehicle:
    """The 30 mm Basic Finner of the aeroballistic range.

    m = 1.5894 kg, Ix = 1.92e-4, Iy = Iz = 9.785e-3 kg m^2, centre of gravity and moment reference 5.50 d from
    the nose, S = pi d^2/4, rates per ``q d/2V``. Source: Dupuis & Hathaway, DREV-TM-9703 (1997).
    """
    calibre = 0.030
    centre = (5.50 * calibre, 0.0, 0.0)
    return Vehicle(
        name="Basic Finner, 30 mm range model",
        mass=1.5894,
        inertia=axisymmetric_inertia(1.92e-4, 9.785e-3),
        reference=ReferenceQuantities(length=calibre, area=math.pi * calibre**2 / 4.0, moment_reference=centre),
        centre_of_gravity=centre,
    )
