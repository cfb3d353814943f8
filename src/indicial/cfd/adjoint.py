r"""Sensitivities by transposed solves: one for a load gives its derivatives with respect to every input.

    J^T y = c^T:    dC/du = D - y^T B          J^T z = E^T y:    dC/d(du/ds) = z^T B

for V_b and omega; Mach number and moment reference follow by the chain rule, as both act on the flow through V_b.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

import numpy as np

from indicial.cfd.operator import FlowOperator, SolveCount
from indicial.conventions import COEFFICIENTS, Array, mesh_from_body
from indicial.sensitivity import Sensitivities


def sensitivities(operators: Sequence[FlowOperator]) -> Sensitivities:
    """Derivatives of the six coefficients, by two transposed solves for each of them."""
    motions, accelerations = np.zeros((6, 6)), np.zeros((6, 6))
    for operator in operators:
        b = np.concatenate(operator.velocity_and_rate, axis=1)
        direct = np.concatenate(operator.direct, axis=1)
        allowed = operator.allowed_axes
        for row, output in enumerate(operator.outputs):
            y = operator.solve(operator.c[row], transposed=True)
            z = operator.solve(operator.apply_mass(y, transposed=True), transposed=True)
            place = COEFFICIENTS.index(output)
            motions[place] += np.where(allowed, direct[row] - y @ b, 0.0)
            accelerations[place] += np.where(allowed, z @ b, 0.0)
    return _labelled(operators, motions, accelerations)


def direct_sensitivities(operators: Sequence[FlowOperator]) -> Sensitivities:
    """The same by two plain solves for each component of V_b and omega: the check on `sensitivities`."""
    motions, accelerations = np.zeros((6, 6)), np.zeros((6, 6))
    for operator in operators:
        b = np.concatenate(operator.velocity_and_rate, axis=1)
        direct = np.concatenate(operator.direct, axis=1)
        rows = [COEFFICIENTS.index(output) for output in operator.outputs]
        for axis in np.flatnonzero(operator.allowed_axes):
            x = operator.solve(-b[:, axis])
            motions[rows, axis] += direct[:, axis] + operator.c @ x
            accelerations[rows, axis] += operator.c @ operator.solve(-operator.apply_mass(x))
    return _labelled(operators, motions, accelerations)


def _labelled(operators: Sequence[FlowOperator], motions: Array, accelerations: Array) -> Sensitivities:
    """From mesh axes and the solver's units to body axes and SI."""
    first = operators[0]
    condition, reference = first.condition, first.reference
    sound, length = condition.speed_of_sound, reference.length
    turn = np.concatenate([mesh_from_body(np.ones(3)) / sound, mesh_from_body(np.ones(3)) * length / sound])
    per_motion = motions * turn
    # d/ds = c/2V d/dt
    per_acceleration = accelerations * turn * length / (2.0 * condition.speed)
    along = condition.velocity / condition.mach
    mach = per_motion[:, :3] @ along - 2.0 * first.baseline / condition.mach
    spent = sum((operator.spent for operator in operators), SolveCount())
    return Sensitivities(
        values=np.concatenate([per_motion, mach[:, None], _moment_reference(first, motions)], axis=1),
        accelerations=per_acceleration,
        baseline=first.baseline,
        condition=condition,
        reference=reference,
        plane=first.plane,
        provenance={"solver": "linearised finite volumes", "cells": first.size // 5} | asdict(spent),
    )


def _moment_reference(operator: FlowOperator, motions: Array) -> Array:
    """d/d(moment reference) [per m], mesh axes, (6, 3): the arms change, and so does the velocity elsewhere."""
    length, arms = operator.reference.length, operator.reference.moment_lengths
    force = operator.baseline[:3]
    out = np.zeros((6, 3))
    for axis, unit in enumerate(np.eye(3)):
        # with V_b kept at the point that has moved, the mesh moves by -omega x dr more
        out[:, axis] = motions[:, :3] @ -np.cross(operator.omega, unit) / length
        out[3:, axis] += np.cross(-unit, force) * [-1.0, 1.0, -1.0] / arms
    return out
