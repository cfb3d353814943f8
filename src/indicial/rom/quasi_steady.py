r"""The quasi-steady derivative model, Eq. (16), and how far in frequency it holds.

``C(s) = C_0 + C_a (alpha - alpha_0) + C_q q + C_ad d(alpha)/ds``: the convolution of Eq. (13) with each deficiency
function replaced by its integral (17). It is the tangent of ``H(ik)`` at k = 0, and fails where ``H`` bends away.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from indicial.conventions import Array, ReferenceQuantities
from indicial.derivatives import DerivativeTable
from indicial.errors import InputError
from indicial.motion import FlightCondition
from indicial.rom.deficiency import deficiency_integral
from indicial.rom.model import ComplexArray, ReducedModel
from indicial.rom.response import StepResponses
from indicial.rom.signals import ANGLES, MotionInputs

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class QuasiSteadyModel(ReducedModel):
    """Loads from derivatives only (Eq. 16).

    Parameters
    ----------
    static : ndarray
        C_alpha and C_q per rad and per ``q c/2V``, shape (n_outputs, n_inputs).
    rates : ndarray
        Derivatives with respect to ``d(input)/ds``: C_alphadot per ``alphadot c/2V``; zero for inputs that are
        rates themselves, as in Eq. (16). Shape (n_outputs, n_inputs).
    inputs, outputs : tuple of str
    baseline : ndarray
        (CA, CY, CN, Cl, Cm, Cn) at the condition, shape (6,).
    condition : FlightCondition
    reference : ReferenceQuantities
    """

    static: Array
    rates: Array
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    baseline: Array
    condition: FlightCondition
    reference: ReferenceQuantities

    def __post_init__(self) -> None:
        shape = (len(self.outputs), len(self.inputs))
        for name in ("static", "rates"):
            values = np.asarray(getattr(self, name), dtype=float)
            if values.shape != shape or not np.all(np.isfinite(values)):
                raise InputError(f"quasi-steady {name} derivatives must be finite and of shape {shape}")
            object.__setattr__(self, name, values)
        self._check_names()

    @classmethod
    def from_responses(cls, responses: StepResponses) -> Self:
        """Final values, and integrals of the deficiency functions of angles (Eq. 17).

        Raises
        ------
        NoLimitError
            If such an integral has no limit.
        """
        rates = np.zeros((len(responses.outputs), len(responses.inputs)))
        for j, response in enumerate(responses.responses):
            if response.input not in ANGLES:
                continue
            for i, output in enumerate(responses.outputs):
                final = None if response.final is None else float(response.final[i])
                name = f"{output}_{response.input}dot"
                rates[i, j] = -deficiency_integral(response.s, response.values[:, i], final, name=name).value
        return cls(
            static=responses.final,
            rates=rates,
            inputs=responses.inputs,
            outputs=responses.outputs,
            baseline=responses.baseline,
            condition=responses.condition,
            reference=responses.reference,
        )

    @classmethod
    def from_table(
        cls,
        table: DerivativeTable,
        condition: FlightCondition,
        reference: ReferenceQuantities,
        baseline: ArrayLike,
        outputs: tuple[str, ...] = ("CN", "Cm"),
        **wanted: Any,
    ) -> Self:
        """From ``CN_alpha``, ``CN_alphadot``, ``CN_q``, ... of a table, each the only one with fields `wanted`.

        Raises
        ------
        InputError
            If a derivative is missing or given more than once.
        """

        def per_half_chord(name: str) -> float:
            record = table.one(name, **wanted)
            return record.value * (1.0 if record.rate_normalisation == "c/2V" else 2.0)

        static = [[table.value(f"{out}_alpha", **wanted), per_half_chord(f"{out}_q")] for out in outputs]
        rates = [[per_half_chord(f"{out}_alphadot"), 0.0] for out in outputs]
        return cls(
            static=np.array(static),
            rates=np.array(rates),
            inputs=("alpha", "q"),
            outputs=outputs,
            baseline=np.asarray(baseline, dtype=float),
            condition=condition,
            reference=reference,
        )

    @property
    def static_gain(self) -> Array:
        """Shape (n_outputs, n_inputs)."""
        return self.static

    @property
    def rate_gain(self) -> Array:
        """Shape (n_outputs, n_inputs)."""
        return self.rates

    def frequency_response(self, k: ArrayLike) -> ComplexArray:
        """``C_u + ik C_udot``, shape (n_k, n_outputs, n_inputs)."""
        ks = np.atleast_1d(np.asarray(k, dtype=float))
        response: ComplexArray = self.static + 1j * ks[:, None, None] * self.rates
        return response

    def respond(self, inputs: MotionInputs) -> Array:
        """Loads less `baseline`, shape (n, n_outputs); a jump's infinite rate is left out, as it must be."""
        if inputs.s.size < 3:
            raise InputError("the quasi-steady model needs three samples of a motion, to know its rates")
        slope = np.gradient(inputs.values, inputs.s, axis=0, edge_order=2)
        loads: Array = inputs.values @ self.static.T + slope @ self.rates.T
        return loads[:: inputs.stride]

    def summary(self) -> str:
        """The derivatives."""
        return self.derivatives().summary()


@dataclass(frozen=True)
class QuasiSteadyError:
    """What replacing a model by its derivatives costs in a forced pitch oscillation, over frequency.

    Parameters
    ----------
    k : ndarray
        Reduced frequencies, shape (n,).
    outputs : tuple of str
    in_phase, out_of_phase : ndarray
        ``Re(H_a + ik H_q)`` and ``Im(H_a + ik H_q)/k`` of the full model, shape (n, n_outputs).
    quasi_in_phase, quasi_out_of_phase : ndarray
        The same of the quasi-steady model.
    """

    k: Array
    outputs: tuple[str, ...]
    in_phase: Array
    out_of_phase: Array
    quasi_in_phase: Array
    quasi_out_of_phase: Array

    @property
    def damping_error(self) -> Array:
        """Error of the out-of-phase part relative to the full model's, shape (n, n_outputs)."""
        error: Array = np.abs(self.quasi_out_of_phase - self.out_of_phase) / np.abs(self.out_of_phase)
        return error

    def limit(self, output: str, tolerance: float = 0.05) -> float:
        """Largest of the k given up to which the damping part is within `tolerance`; 0 if none."""
        if output not in self.outputs:
            raise InputError(f"no output {output!r}; there are {', '.join(self.outputs)}")
        bad = np.nonzero(self.damping_error[:, self.outputs.index(output)] > tolerance)[0]
        if bad.size == 0:
            return float(self.k[-1])
        return float(self.k[bad[0] - 1]) if bad[0] > 0 else 0.0

    def summary(self, tolerance: float = 0.05) -> str:
        """Up to which k each output's damping part holds."""
        return "\n".join(
            f"{name}: quasi-steady damping within {tolerance:.0%} up to k = {self.limit(name, tolerance):.3g}"
            for name in self.outputs
        )

    def plot(self) -> Figure:
        """In-phase and out-of-phase parts over k, full and quasi-steady."""
        import matplotlib.pyplot as plt

        rows = len(self.outputs)
        figure, axes = plt.subplots(rows, 2, squeeze=False, sharex=True, figsize=(9.0, 2.8 * rows))
        for i, name in enumerate(self.outputs):
            parts = (
                ("in phase", self.in_phase, self.quasi_in_phase),
                ("out of phase / k", self.out_of_phase, self.quasi_out_of_phase),
            )
            for ax, (label, full, quasi) in zip(axes[i], parts, strict=True):
                ax.semilogx(self.k, full[:, i], label="full response")
                ax.semilogx(self.k, quasi[:, i], "--", label="quasi-steady, Eq. (16)")
                ax.set_ylabel(f"{name} {label}")
        axes[0, 0].legend()
        for ax in axes[-1]:
            ax.set_xlabel("reduced frequency k")
        figure.tight_layout()
        return figure


def quasi_steady_error(quasi: ReducedModel, full: ReducedModel, k: Sequence[float] | Array) -> QuasiSteadyError:
    """Compare the pitch oscillations of two models with inputs alpha and q, over reduced frequencies k."""
    for model in (quasi, full):
        if not {"alpha", "q"} <= set(model.inputs):
            raise InputError(f"a pitch oscillation needs inputs alpha and q; the model has {', '.join(model.inputs)}")
    if quasi.outputs != full.outputs:
        raise InputError(f"the models' outputs differ: {quasi.outputs} and {full.outputs}")
    ks = np.sort(np.asarray(k, dtype=float))
    if ks.size == 0 or ks[0] <= 0.0:
        raise InputError("reduced frequencies must be positive")
    pitch = {}
    for label, model in (("quasi", quasi), ("full", full)):
        h = model.frequency_response(ks)
        a, q = (model.inputs.index(name) for name in ("alpha", "q"))
        pitch[label] = h[:, :, a] + 1j * ks[:, None] * h[:, :, q]
    return QuasiSteadyError(
        k=ks,
        outputs=full.outputs,
        in_phase=pitch["full"].real,
        out_of_phase=pitch["full"].imag / ks[:, None],
        quasi_in_phase=pitch["quasi"].real,
        quasi_out_of_phase=pitch["quasi"].imag / ks[:, None],
    )
