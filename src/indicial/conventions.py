r"""Axes, reduced time and frequency, reference quantities and moment transfer.

Body axes of flight dynamics: x forward, y right, z down, origin at the moment reference point.
Mesh axes: x aft, y right, z up, origin at the nose. They are one another turned by pi about y, so
x and z components (CA's force, roll and yaw) change sign and y components (pitch) do not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from indicial.errors import InputError

Array = NDArray[np.float64]
Index = NDArray[np.integer[Any]]
"""Indices into arrays, of any integer width."""

COEFFICIENTS = ("CA", "CY", "CN", "Cl", "Cm", "Cn")
"""The six load coefficients: ``CA = -CX``, ``CN = -CZ``, Cl right wing down, Cm nose up, Cn nose right."""

RateNormalisation = Literal["c/2V", "c/V"]

_TURN: Array = np.array([-1.0, 1.0, -1.0])


def mesh_from_body(vector: ArrayLike) -> Array:
    """Components in mesh axes (x aft, y right, z up) of ``(..., 3)`` vectors given in body axes."""
    turned: Array = np.asarray(vector, dtype=float) * _TURN
    return turned


def body_from_mesh(vector: ArrayLike) -> Array:
    """Components in body axes (x forward, y right, z down) of ``(..., 3)`` vectors in mesh axes."""
    turned: Array = np.asarray(vector, dtype=float) * _TURN
    return turned


@dataclass(frozen=True)
class ReferenceQuantities:
    """What loads and rates are made dimensionless with.

    Parameters
    ----------
    length : float
        Moment reference length c [m]: chord, or calibre of a missile. Also makes k and s.
    area : float
        Reference area S [m^2].
    moment_reference : tuple of float
        Moment reference point, mesh axes [m]: (x, y, z) from the nose, x aft.
    lateral_length : float, optional
        Length of roll and yaw moments and rates [m] (a wing's span); `length` if not given.
    rate_normalisation : {"c/2V", "c/V"}
        Whether rate derivatives are per ``q c/2V`` (the default) or per ``q c/V``.
    """

    length: float
    area: float
    moment_reference: tuple[float, float, float] = (0.0, 0.0, 0.0)
    lateral_length: float | None = None
    rate_normalisation: RateNormalisation = "c/2V"

    def __post_init__(self) -> None:
        for name in ("length", "area"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(f"reference {name} is {value}, must be positive and finite")
        if self.lateral_length is not None and not (math.isfinite(self.lateral_length) and self.lateral_length > 0.0):
            raise InputError(f"reference lateral_length is {self.lateral_length}, must be positive and finite")
        if not all(math.isfinite(value) for value in self.moment_reference):
            raise InputError(f"moment reference is {self.moment_reference}, must be finite")
        if self.rate_normalisation not in ("c/2V", "c/V"):
            raise InputError(f"rate_normalisation is {self.rate_normalisation!r}, must be 'c/2V' or 'c/V'")

    @property
    def moment_lengths(self) -> Array:
        """Lengths of (Cl, Cm, Cn) [m], shape (3,)."""
        lateral = self.length if self.lateral_length is None else self.lateral_length
        return np.array([lateral, self.length, lateral])

    def rate_scale(self, speed: float) -> Array:
        """Seconds that turn (p, q, r) [rad/s] into dimensionless rates, shape (3,)."""
        factor = 2.0 if self.rate_normalisation == "c/2V" else 1.0
        return self.moment_lengths / (factor * speed)

    def about(self, moment_reference: tuple[float, float, float]) -> Self:
        """The same quantities about another moment reference point."""
        return replace(self, moment_reference=moment_reference)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for files."""
        return {
            "length_m": self.length,
            "area_m2": self.area,
            "moment_reference_m": list(self.moment_reference),
            "lateral_length_m": self.lateral_length,
            "rate_normalisation": self.rate_normalisation,
        }

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Self:
        """Inverse of `to_dict`."""
        x, y, z = (float(v) for v in values["moment_reference_m"])
        return cls(
            length=float(values["length_m"]),
            area=float(values["area_m2"]),
            moment_reference=(x, y, z),
            lateral_length=values.get("lateral_length_m"),
            rate_normalisation=values.get("rate_normalisation", "c/2V"),
        )


def reduced_time(time: ArrayLike, speed: float, length: float) -> Array:
    """``s = 2 U t / c``."""
    return 2.0 * speed * np.asarray(time, dtype=float) / length


def time_from_reduced(s: ArrayLike, speed: float, length: float) -> Array:
    """``t = s c / 2U`` [s]."""
    return np.asarray(s, dtype=float) * length / (2.0 * speed)


def reduced_frequency(omega: float, speed: float, length: float) -> float:
    """``k = omega c / 2U`` (Eq. 5), omega in rad/s."""
    return omega * length / (2.0 * speed)


def angular_frequency(k: float, speed: float, length: float) -> float:
    """``omega = 2 U k / c`` [rad/s] (Eq. 5)."""
    return 2.0 * speed * k / length


def velocity_from_angles(speed: float, alpha: float, beta: float = 0.0) -> Array:
    """Body velocity V_b [m/s], body axes, shape (3,): alpha = atan2(w, u), beta = asin(v/V) [rad]."""
    return speed * np.array([math.cos(alpha) * math.cos(beta), math.sin(beta), math.sin(alpha) * math.cos(beta)])


def turning(angle: str, alpha: float, beta: float) -> Array:
    """Derivative of the direction of V_b, body axes, with respect to alpha or beta, shape (3,)."""
    ca, sa, cb, sb = math.cos(alpha), math.sin(alpha), math.cos(beta), math.sin(beta)
    directions = {"alpha": np.array([-sa * cb, 0.0, ca * cb]), "beta": np.array([-ca * sb, cb, -sa * sb])}
    if angle not in directions:
        raise InputError(f"no angle {angle!r}; there are {', '.join(directions)}")
    return directions[angle]


def flow_angles(velocity: ArrayLike) -> tuple[Array, Array, Array]:
    """Speed [m/s], alpha and beta [rad] of body velocities ``(..., 3)``; alpha and beta are 0 at rest."""
    v = np.asarray(velocity, dtype=float)
    speed = np.sqrt(np.sum(v * v, axis=-1))
    alpha = np.arctan2(v[..., 2], v[..., 0])
    beta = np.arcsin(np.divide(v[..., 1], speed, out=np.zeros_like(speed), where=speed > 0.0))
    return speed, alpha, beta


def transfer_longitudinal(
    derivatives: dict[str, float], shift: float, rate_normalisation: RateNormalisation = "c/2V"
) -> dict[str, float]:
    """Longitudinal derivatives about a point `shift` reference lengths further aft.

    ``Cm_a' = Cm_a + D CN_a``, ``CN_q' = CN_q - f D CN_a``,
    ``Cm_q' = Cm_q + D CN_q - f D Cm_a - f D^2 CN_a``, ``Cm_ad' = Cm_ad + D CN_ad`` with f = 2 for rates
    per ``c/2V`` and 1 for ``c/V``; CN_a and CN_ad do not change. Exact at alpha = 0: at incidence C_a stands where
    the derivative with respect to the velocity across the body, ``V dC/dw``, belongs.

    Parameters
    ----------
    derivatives : dict
        Any of CN_alpha, Cm_alpha, CN_q, Cm_q, CN_alphadot, Cm_alphadot; what a formula needs must be there.
    shift : float
        D, reference lengths aft.

    Returns
    -------
    dict
        The derivatives that could be transferred.
    """
    d, f = shift, (2.0 if rate_normalisation == "c/2V" else 1.0)
    needs = {
        "CN_alpha": ("CN_alpha",),
        "CN_alphadot": ("CN_alphadot",),
        "Cm_alpha": ("Cm_alpha", "CN_alpha"),
        "Cm_alphadot": ("Cm_alphadot", "CN_alphadot"),
        "CN_q": ("CN_q", "CN_alpha"),
        "Cm_q": ("Cm_q", "CN_q", "Cm_alpha", "CN_alpha"),
    }
    weights: dict[str, tuple[float, ...]] = {
        "CN_alpha": (1.0,),
        "CN_alphadot": (1.0,),
        "Cm_alpha": (1.0, d),
        "Cm_alphadot": (1.0, d),
        "CN_q": (1.0, -f * d),
        "Cm_q": (1.0, d, -f * d, -f * d * d),
    }
    return {
        name: sum(w * derivatives[term] for w, term in zip(weights[name], terms, strict=True))
        for name, terms in needs.items()
        if all(term in derivatives for term in terms)
    }
