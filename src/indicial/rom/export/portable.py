"""A model as a simulator takes it: motion in rad, rad/s and m/s, time in seconds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from indicial.conventions import COEFFICIENTS, Array
from indicial.rom.modal import ModalForm
from indicial.rom.signals import ANGLES
from indicial.rom.state_space import StateSpaceModel

MEANING = {
    "alpha": "angle of attack atan2(w, u)",
    "beta": "angle of sideslip asin(v/V)",
    "p": "roll rate, right wing down positive",
    "q": "pitch rate, nose up positive",
    "r": "yaw rate, nose right positive",
    "CA": "axial force coefficient, -X/(qbar S), x forward",
    "CY": "side force coefficient, Y/(qbar S), y right",
    "CN": "normal force coefficient, -Z/(qbar S), z down",
    "Cl": "rolling moment coefficient, right wing down positive",
    "Cm": "pitching moment coefficient, nose up positive",
    "Cn": "yawing moment coefficient, nose right positive",
}
"""Inputs and coefficients in words."""


@dataclass(frozen=True)
class Portable:
    r"""Modes of a model, and what makes its inputs of a motion.

    ``u = motion - offset`` for angles, ``u = length motion/(2V)`` for rates; ``ds = 2V dt/c``; the loads are all six
    coefficients, ``baseline + Re(c x) + D u``.

    Parameters
    ----------
    model : StateSpaceModel
    modes : ModalForm
        Rows of c and d for all six coefficients, zero where there is no output.
    offsets : ndarray
        alpha and beta of the model's condition [rad], 0 for rates, shape (n_inputs,).
    lengths : ndarray
        Length of each rate [m], 0 for angles, shape (n_inputs,).
    """

    model: StateSpaceModel
    modes: ModalForm
    offsets: Array
    lengths: Array

    @classmethod
    def of(cls, model: StateSpaceModel) -> Portable:
        """The model in this form.

        Raises
        ------
        InputError
            If it has no modal form.
        """
        modes = model.modes()
        rows = [COEFFICIENTS.index(name) for name in model.outputs]
        c, d = np.zeros((6, modes.poles.size), dtype=complex), np.zeros((6, len(model.inputs)))
        c[rows], d[rows] = modes.c, modes.d
        condition, lengths = model.condition, dict(zip("pqr", model.reference.moment_lengths, strict=True))
        return cls(
            model,
            ModalForm(modes.real, modes.poles, modes.b, c, d),
            np.array([getattr(condition, name) if name in ANGLES else 0.0 for name in model.inputs]),
            np.array([lengths.get(name, 0.0) for name in model.inputs]),
        )

    def unit(self, name: str) -> str:
        """Unit of an input or a coefficient."""
        return "1" if name in COEFFICIENTS else "rad" if name in ANGLES else "rad/s"

    def notes(self) -> list[str]:
        """What whoever uses the model must know, in lines of text."""
        reference, condition = self.model.reference, self.model.condition
        x, y, z = map(_exact, reference.moment_reference)
        area, length = _exact(reference.area), _exact(reference.length)
        alpha, beta = _exact(condition.alpha), _exact(condition.beta)
        lengths = ", ".join(map(_exact, reference.moment_lengths))
        return [
            f"Unsteady aerodynamic loads at Mach {condition.mach:g}, linear about alpha = {alpha}, beta = {beta} rad.",
            "Body axes: x forward, y right, z down, origin at the moment reference point, which lies",
            f"({x}, {y}, {z}) m from the nose in mesh axes (x aft, y right, z up).",
            f"Reference area {area} m2; lengths of Cl, Cm, Cn: {lengths} m; length of reduced time {length} m.",
            f"{self.model.order} states. Inputs: "
            + "; ".join(f"{name} [{self.unit(name)}], {MEANING[name]}" for name in self.model.inputs)
            + ".",
            f"Unsteady: {', '.join(self.model.outputs)}; the other coefficients stay at their steady values.",
        ]


def _exact(value: float) -> str:
    return repr(float(value))
