r"""What the damping of a missile's arms is made of: its derivative by each aerodynamic derivative, and its uncertainty.

For an eigenvalue ``lambda`` of the matrix A of the motion over distance (`modes`), with left and right eigenvectors

    A x = lambda x,  y^H A = lambda y^H,    d lambda/d v = y^H (dA/dv) x / (y^H x),

exact for a simple eigenvalue; dA/dv is casadi's derivative of the equations flown. Source: Lancaster, Numer. Math. 6
(1964) 377. The standard error of a quantity with gradient g is ``sqrt(g^T C g)``, C the covariance of the derivatives.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.flightsim.aerodynamics import DERIVATIVES, DerivativeAerodynamics
from indicial.flightsim.atmosphere import Atmosphere, ConstantAtmosphere
from indicial.flightsim.dynamics import Dynamics, build_dynamics
from indicial.flightsim.earth import FlatEarth
from indicial.flightsim.epicycle import Complex, order_arms
from indicial.flightsim.expressions import is_number
from indicial.flightsim.initial import InitialState
from indicial.flightsim.modes import LinearModel, complex_plane, over_distance
from indicial.flightsim.vehicle import Vehicle

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAMES = tuple(name for name in DERIVATIVES if name != "Cl_p")
"""Derivatives that the arms' damping depends on."""


@dataclass(frozen=True)
class ArmSensitivity:
    """One arm's eigenvalue and its exact gradient.

    Parameters
    ----------
    name : str
        "fast arm" or "slow arm".
    eigenvalue : complex
        [1/s], over distance times V.
    gradient : ndarray
        d eigenvalue/d derivative [1/s], complex, in the order of `NAMES`.
    values : ndarray
        The derivatives.
    covariance : ndarray
        Of the derivatives, shape (n, n); zeros where nothing is known.
    """

    name: str
    eigenvalue: complex
    gradient: Complex
    values: Array
    covariance: Array

    @property
    def damping(self) -> float:
        """Real part [1/s]."""
        return self.eigenvalue.real

    @property
    def damping_ratio(self) -> float:
        """``-Re/|eigenvalue|``."""
        return -self.eigenvalue.real / abs(self.eigenvalue)

    @property
    def damping_gradient(self) -> Array:
        """d damping/d derivative [1/s]."""
        real: Array = self.gradient.real
        return real

    @property
    def ratio_gradient(self) -> Array:
        """d damping ratio/d derivative."""
        size = abs(self.eigenvalue)
        growth = (self.eigenvalue.conjugate() * self.gradient).real / size
        gradient: Array = -self.gradient.real / size + self.eigenvalue.real * growth / size**2
        return gradient

    @property
    def standard_error(self) -> float:
        """Of the damping [1/s]."""
        return _standard_error(self.damping_gradient, self.covariance)

    @property
    def ratio_standard_error(self) -> float:
        """Of the damping ratio."""
        return _standard_error(self.ratio_gradient, self.covariance)

    @property
    def margin(self) -> float:
        """How many standard errors the damping is from growing; infinite if nothing is uncertain."""
        error = self.standard_error
        return -self.damping / error if error else math.copysign(math.inf, -self.damping)

    @property
    def parts(self) -> dict[str, float]:
        """The damping [1/s] taken apart: each derivative times its sensitivity, and the remainder.

        "lift" is ``CN_alpha - CA_0`` and "slowing" is drag's own share, as in the closed form (`damping`), in which
        half of what CA_0 does is each. At zero roll the closed form is linear in them, and the remainder is products
        of small terms; with roll the two arms share their damping by a rule that is not linear, and it may be large.
        """
        share = dict(zip(NAMES, (self.values * self.damping_gradient).tolist(), strict=True))
        parts = {
            "Cm_q": share["Cm_q"],
            "Cm_alphadot": share["Cm_alphadot"],
            "lift": share["CN_alpha"] + 0.5 * share["CA_0"],
            "slowing": 0.5 * share["CA_0"],
            "Cm_alpha": share["Cm_alpha"],
            "CN_q, CN_alphadot": share["CN_q"] + share["CN_alphadot"],
        }
        return parts | {"remainder": self.damping - sum(parts.values())}


@dataclass(frozen=True)
class DampingSensitivity:
    """What the damping of both arms is made of, and how sure it is.

    Parameters
    ----------
    arms : tuple of ArmSensitivity
        Fast, slow.
    speed, roll_rate : float
        [m/s], [rad/s].
    """

    arms: tuple[ArmSensitivity, ArmSensitivity]
    speed: float
    roll_rate: float

    def summary(self) -> str:
        """Damping with its standard error, its parts, and the sensitivities."""
        lines = [f"damping at {self.speed:.5g} m/s, roll rate {self.roll_rate:.4g} rad/s, and what it is made of"]
        for arm in self.arms:
            lines.append(
                f"  {arm.name}: damping {arm.damping:.6g} +- {arm.standard_error:.2g} 1/s, "
                f"ratio {arm.damping_ratio:.5g} +- {arm.ratio_standard_error:.2g}"
            )
            lines += [f"    {name:<18}{part:>12.5g} 1/s" for name, part in arm.parts.items()]
            lines.append(f"    {'derivative':<14}{'value':>12}{'error':>10}{'d damping':>14}{'d ratio':>14}")
            errors = np.sqrt(np.diag(arm.covariance))
            rows = zip(NAMES, arm.values, errors, arm.damping_gradient, arm.ratio_gradient, strict=True)
            lines += [f"    {n:<14}{v:>12.5g}{e:>10.3g}{d:>14.5g}{r:>14.5g}" for n, v, e, d, r in rows]
        return "\n".join(lines)

    def plot(self) -> Figure:
        """The parts of each arm's damping as bars, and the whole with its standard error."""
        import matplotlib.pyplot as plt

        figure, axes = plt.subplots(1, 2, figsize=(10, 4), layout="constrained", sharex=True)
        for ax, arm in zip(axes, self.arms, strict=True):
            parts = arm.parts
            ax.barh([*parts, "whole"], [*parts.values(), arm.damping], color=["C0"] * len(parts) + ["0.4"])
            ax.errorbar(arm.damping, len(parts), xerr=arm.standard_error, color="k", capsize=4)
            ax.axvline(0.0, color="k", linewidth=0.8)
            ax.invert_yaxis()
            ax.set(title=arm.name, xlabel="damping [1/s], negative dies out")
        return figure


def damping_sensitivity(
    vehicle: Vehicle,
    aerodynamics: DerivativeAerodynamics,
    speed: float,
    *,
    roll_rate: float = 0.0,
    atmosphere: Atmosphere | None = None,
    altitude: float = 0.0,
    uncertainties: Mapping[str, float] | None = None,
    correlations: Mapping[tuple[str, str], float] | None = None,
) -> DampingSensitivity:
    """Exact sensitivities of the arms' damping to each derivative, with the uncertainty carried through.

    Parameters
    ----------
    vehicle : Vehicle
    aerodynamics : DerivativeAerodynamics
        With numbers; about its own moment reference point.
    speed : float
        [m/s].
    roll_rate : float
        [rad/s].
    atmosphere : Atmosphere, optional
        20 C and 1 atm if not given.
    altitude : float
        [m].
    uncertainties : mapping, optional
        Standard error by derivative name.
    correlations : mapping, optional
        Between two derivatives, by the pair of their names; 0 if not given. What a free flight identifies has Cm_q
        and Cm_alphadot correlated by nearly -1: it measures their sum.

    Raises
    ------
    InputError
        For a value that is not a number, an unknown name, a covariance that is none, or equal eigenvalues.
    """
    values = [getattr(aerodynamics, name) for name in NAMES]
    for name, value in zip(NAMES, values, strict=True):
        if not is_number(value):
            raise InputError(f"{name} is an expression: sensitivities need a number")
    if not (math.isfinite(speed) and speed > 0.0):
        raise InputError(f"speed is {speed} m/s, must be positive and finite")
    covariance = derivative_covariance(uncertainties or {}, correlations or {})
    air = ConstantAtmosphere() if atmosphere is None else atmosphere
    dynamics = build_dynamics(vehicle, aerodynamics.with_symbols(NAMES), air, FlatEarth(0.0))
    given = dynamics.parameter_vector({n: float(v) for n, v in zip(NAMES, values, strict=True)})
    initial = InitialState.from_path(speed, rate=(roll_rate, 0.0, 0.0), position=(0.0, 0.0, -altitude))
    state = dynamics.initial_vector(initial, given)
    matrix, changes = _matrices(dynamics, state, given, speed)
    roots, right = np.linalg.eig(matrix)
    if abs(roots[0] - roots[1]) < 1e-9 * np.max(np.abs(roots)):
        raise InputError("both arms have one eigenvalue (critically damped): it has no derivative")
    left = np.linalg.inv(right)
    order = [dynamics.parameter_names.index(name) for name in NAMES]
    by_root: dict[complex, Complex] = {}
    for i in range(2):
        gradient: Complex = np.array([left[i] @ changes[j] @ right[:, i] for j in order], dtype=np.complex128)
        by_root[complex(roots[i])] = gradient * speed
    turning = 1j * roll_rate / speed
    ordered = order_arms(*(root + turning for root in by_root))
    nearest = [min(by_root, key=lambda root, arm=arm: abs(root + turning - arm)) for arm in ordered]  # type: ignore[misc]
    arms = [
        ArmSensitivity(name, (root + turning) * speed, by_root[root], np.array(values, dtype=float), covariance)
        for name, root in zip(("fast arm", "slow arm"), nearest, strict=True)
    ]
    return DampingSensitivity((arms[0], arms[1]), speed, roll_rate)


def derivative_covariance(uncertainties: Mapping[str, float], correlations: Mapping[tuple[str, str], float]) -> Array:
    """Covariance of the derivatives in the order of `NAMES`.

    Raises
    ------
    InputError
        For an unknown name, a negative uncertainty, or correlations that cannot be together.
    """
    for name in (*uncertainties, *(name for pair in correlations for name in pair)):
        if name not in NAMES:
            raise InputError(f"no derivative {name!r} that damping depends on; there are {', '.join(NAMES)}")
    for name, value in uncertainties.items():
        if not (math.isfinite(value) and value >= 0.0):
            raise InputError(f"uncertainty of {name} is {value}, must be finite and not negative")
    matrix = np.eye(len(NAMES))
    for (one, other), value in correlations.items():
        i, j = NAMES.index(one), NAMES.index(other)
        if i == j or not abs(value) <= 1.0:
            raise InputError(f"correlation of {one} and {other} is {value}: needs two derivatives and -1 to 1")
        matrix[i, j] = matrix[j, i] = value
    if np.linalg.eigvalsh(matrix)[0] < -1e-9:
        raise InputError("the correlations contradict each other: their matrix is not positive semidefinite")
    errors = np.array([uncertainties.get(name, 0.0) for name in NAMES])
    covariance: Array = errors[:, None] * matrix * errors[None, :]
    return covariance


def _matrices(dynamics: Dynamics, state: Array, given: Array, speed: float) -> tuple[Complex, list[Complex]]:
    """The complex matrix over distance [1/m], and its derivative by each parameter."""
    x, p = ca.SX.sym("state", state.size), ca.SX.sym("parameters", given.size)
    rate = dynamics.derivative(x, p, 0.0)
    jacobian = ca.jacobian(rate, x)
    outputs: list[Any] = [jacobian, rate, ca.jacobian(ca.vec(jacobian), p), ca.jacobian(rate, p)]
    a, f, da, df = (np.array(value) for value in ca.Function("matrices", [x, p], outputs)(state, given))

    def plane(matrix: Array, forcing: Array) -> Complex:
        return complex_plane(over_distance(LinearModel(matrix, state, forcing, dynamics.state_names), speed), 0)

    n = state.size
    changes = [plane(da[:, j].reshape((n, n), order="F"), df[:, j]) for j in range(given.size)]
    return plane(a, f.ravel()), changes


def _standard_error(gradient: Array, covariance: Array) -> float:
    return math.sqrt(max(float(gradient @ covariance @ gradient), 0.0))
