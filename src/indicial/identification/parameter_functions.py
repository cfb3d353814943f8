r"""Coefficients that change with the flight condition, as expressions whose coefficients are parameters.

    polynomial("Cm_q", MACH, 2, about=2.0)                 Cm_q_0 + Cm_q_1 (M - 2) + Cm_q_2 (M - 2)^2
    polynomial("Cm_alpha", ca.sin(TOTAL_ANGLE) ** 2, 1)    Cm_alpha_0 + Cm_alpha_1 sin^2 delta
    spline("CZ_alpha", ALPHA, [-0.1, 0.0, 0.1, 0.2])       a cubic spline whose parameters are its values at the knots

A spline is natural (straight beyond its ends) and linear in its values, so that one whose values lie on a line is that
line. Source: de Boor, "A Practical Guide to Splines" (1978), ch. IV.
"""

from __future__ import annotations

import math
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from indicial.conventions import Array
from indicial.errors import InputError


def polynomial(name: str, argument: Any, degree: int, *, about: float = 0.0) -> Any:
    """``name_0 + name_1 (x - about) + ... + name_n (x - about)^n``, a casadi expression with these symbols.

    Parameters
    ----------
    name : str
    argument : expression
        x, of `indicial.flightsim.expressions`.
    degree : int
    about : float
        Where `name_0` is the value: in the middle of the data the parameters depend least on one another.

    Raises
    ------
    InputError
        If the degree is negative or `about` not finite.
    """
    if degree < 0 or not math.isfinite(about):
        raise InputError(f"a polynomial needs a degree of 0 or more, not {degree}, about a finite value, not {about}")
    total, power = ca.SX(0.0), ca.SX(1.0)
    for i in range(degree + 1):
        total += ca.SX.sym(f"{name}_{i}") * power
        power *= argument - about
    return total


def spline(name: str, argument: Any, knots: ArrayLike) -> Any:
    """Natural cubic spline with values ``name_0, ..., name_n`` at the knots, straight beyond them.

    Parameters
    ----------
    name : str
    argument : expression
    knots : array_like
        Increasing, three or more.

    Raises
    ------
    InputError
        If there are too few, or they do not increase.
    """
    at = np.asarray(knots, dtype=float)
    if at.ndim != 1 or at.size < 3 or not np.all(np.isfinite(at)) or np.any(np.diff(at) <= 0.0):
        raise InputError(f"a spline needs three or more knots, finite and increasing, not {at}")
    values = ca.vertcat(*(ca.SX.sym(f"{name}_{i}") for i in range(at.size)))
    intercept, slope, cubes = _truncated_powers(at)
    total = ca.mtimes(ca.DM(intercept).T, values) + ca.mtimes(ca.DM(slope).T, values) * (argument - at[0])
    for i in range(at.size):
        total += ca.mtimes(ca.DM(cubes[i]).T, values) * ca.fmax(argument - at[i], 0.0) ** 3
    return total


def _truncated_powers(knots: Array) -> tuple[Array, Array, Array]:
    """Of each unit spline: value and slope at the first knot (n,), and coefficients of (x - knot)^3_+ (n_knots, n)."""
    from scipy.interpolate import CubicSpline

    unit = CubicSpline(knots, np.eye(knots.size), bc_type="natural")
    third = np.vstack([np.zeros(knots.size), unit.c[0], np.zeros(knots.size)])
    cubes: Array = np.diff(third, axis=0)
    slope: Array = unit(knots[0], 1)
    intercept: Array = unit(knots[0])
    return intercept, slope, cubes
