r"""A flight model from lists of terms: the same terms that equation error has as regressors.

    C = C_0 + sum_i C_i x_i,   C one of CX CY CZ (forces) and Cl Cm Cn (moments), body axes,

each ``x_i`` a product of powers of ``alpha``, ``beta``, ``mach`` and controls, and of one rate at most: ``q`` (and
``alphadot`` in CZ and Cm) in the plane of symmetry, ``p`` or ``r`` out of it, dimensionless as the reference says.
Klein & Morelli, "Aircraft System Identification" (2006), sec. 3.6.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca

from indicial.errors import InputError
from indicial.flightsim import (
    ALPHA,
    BETA,
    MACH,
    Atmosphere,
    BodyAxisAerodynamics,
    Dynamics,
    Force,
    Vehicle,
    build_dynamics,
)

LONGITUDINAL, LATERAL = ("CX", "CZ", "Cm"), ("CY", "Cl", "Cn")
_RATES: Mapping[str, tuple[str, ...]] = {
    **dict.fromkeys(LONGITUDINAL, ("q",)),
    **dict.fromkeys(LATERAL, ("p", "r")),
    "CZ": ("q", "alphadot"),
    "Cm": ("q", "alphadot"),
}
_CONDITIONS = {"alpha": ALPHA, "beta": BETA, "mach": MACH}


def term_names(terms: Mapping[str, Sequence[str]]) -> tuple[str, ...]:
    """Parameters of `term_model`: ``Cm_0, Cm_alpha, Cm_alpha*elevator, ...``."""
    return tuple(f"{name}_{term}" for name, chosen in terms.items() for term in ("0", *chosen))


def term_model(
    vehicle: Vehicle,
    terms: Mapping[str, Sequence[str]],
    controls: Sequence[str] = (),
    atmosphere: Atmosphere | None = None,
    forces: Sequence[Force] = (),
) -> Dynamics:
    """Equations of motion whose parameters are the coefficients of the terms, and the controls.

    Parameters
    ----------
    vehicle : Vehicle
        Its reference makes rates and moments dimensionless.
    terms : mapping
        Of each coefficient its terms, as ``{"Cm": ["alpha", "q", "elevator", "alpha^2"]}``; a coefficient that is
        left out is 0.
    controls : sequence of str
        Names that terms may use besides those of the motion.
    atmosphere : Atmosphere, optional
        As in `build_dynamics`, and
    forces : sequence of Force

    Raises
    ------
    InputError
        If a coefficient or a factor of a term is unknown, a power is no whole number, or a term stands twice.
    """
    symbols = {name: ca.SX.sym(name) for name in controls}
    values: dict[str, Any] = {}
    for name, chosen in terms.items():
        if name not in _RATES:
            raise InputError(f"coefficient {name!r} is none of {', '.join(_RATES)}")
        doubled = [term for i, term in enumerate(chosen) if term in chosen[:i]]
        if doubled:
            raise InputError(f"term {doubled[0]!r} of {name} stands twice")
        for term in ("0", *chosen):
            rate, product = ("0", ca.SX(1.0)) if term == "0" else _factors(name, term, symbols)
            field = f"{name}_{rate}"
            values[field] = values.get(field, 0.0) + ca.SX.sym(f"{name}_{term}") * product
    return build_dynamics(
        vehicle, BodyAxisAerodynamics(reference=vehicle.reference, **values), atmosphere, forces=forces
    )


def _factors(name: str, term: str, controls: Mapping[str, Any]) -> tuple[str, Any]:
    """The rate in a term ("0" for none) and the product of the rest."""
    rate, product = "0", ca.SX(1.0)
    for factor in term.split("*"):
        base, hat, power = factor.strip().partition("^")
        if hat and not (power.isdigit() and int(power) > 0):
            raise InputError(f"power in term {term!r} of {name} must be a whole number from 1, not {power!r}")
        if base in _RATES[name] and not hat and rate == "0":
            rate = base
        elif base in _CONDITIONS or base in controls:
            product = product * (_CONDITIONS | dict(controls))[base] ** int(power or 1)
        else:
            known = ", ".join((*_CONDITIONS, *controls))
            raise InputError(
                f"{factor!r} in term {term!r} of {name} is no factor; allowed: powers of {known}, and once one of "
                f"{', '.join(_RATES[name])}"
            )
    return rate, product
