"""Prediction check: a model against a history it has not seen."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.history import History
from indicial.rom.model import ReducedModel
from indicial.rom.nonlinear import NonlinearModel
from indicial.rom.signals import quadrature_weights

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class CheckedCoefficient:
    """One coefficient, predicted against measured.

    Parameters
    ----------
    name : str
    rms, peak : float
        Root-mean-square and largest error.
    unsteady_rms, unsteady_peak : float
        Root-mean-square and largest value of the measured unsteady part (measured less its mean).
    damping_measured, damping_predicted : float or None
        Out-of-phase part per ``c/2V``, the factor of ``d(theta)/ds`` in a least-squares fit of
        ``1, theta, d(theta)/ds`` with theta the pitch motion; ``C_q + C_alphadot`` of a pitch oscillation. None
        where the motion does not determine it (a step).
    """

    name: str
    rms: float
    peak: float
    unsteady_rms: float
    unsteady_peak: float
    damping_measured: float | None
    damping_predicted: float | None

    @property
    def relative_rms(self) -> float:
        """RMS error relative to the RMS of the unsteady part; infinite if there is none."""
        return self.rms / self.unsteady_rms if self.unsteady_rms > 0.0 else math.inf

    @property
    def relative_peak(self) -> float:
        """Largest error relative to the largest unsteady value; infinite if there is none."""
        return self.peak / self.unsteady_peak if self.unsteady_peak > 0.0 else math.inf

    @property
    def damping_error(self) -> float | None:
        """Error of the out-of-phase part relative to the measured one."""
        if self.damping_measured is None or self.damping_predicted is None or self.damping_measured == 0.0:
            return None
        return abs(self.damping_predicted - self.damping_measured) / abs(self.damping_measured)

    def summary(self) -> str:
        """One line in words."""
        line = (
            f"{self.name}: off by {self.relative_rms:.2%} of the unsteady load (rms), {self.relative_peak:.2%} at worst"
        )
        if self.damping_error is None:
            return line
        return (
            f"{line}; damping part {self.damping_predicted:.5g}, measured {self.damping_measured:.5g}: "
            f"off by {self.damping_error:.2%}"
        )


@dataclass(frozen=True)
class PredictionCheck:
    """A model's prediction beside a measured history.

    Parameters
    ----------
    measured, predicted : History
    since : float
        Reduced time from which they are compared.
    coefficients : tuple of CheckedCoefficient
    """

    measured: History
    predicted: History
    since: float
    coefficients: tuple[CheckedCoefficient, ...]

    def __getitem__(self, name: str) -> CheckedCoefficient:
        """One coefficient by name."""
        for checked in self.coefficients:
            if checked.name == name:
                return checked
        raise InputError(f"{name!r} was not checked; there are {', '.join(c.name for c in self.coefficients)}")

    @property
    def worst(self) -> float:
        """The one figure of merit: largest RMS error relative to the unsteady part, over the coefficients."""
        return max(checked.relative_rms for checked in self.coefficients)

    @property
    def worst_peak(self) -> float:
        """Largest error relative to the largest unsteady load, over the coefficients."""
        return max(checked.relative_peak for checked in self.coefficients)

    def summary(self) -> str:
        """What was predicted, and how well, in words."""
        model = self.predicted.provenance.get("rom", "model")
        kind = self.measured.motion.get("kind", "motion")
        head = f"{model} predicts {kind} at M {self.measured.condition.mach:g} to within {self.worst:.2%}"
        return "\n".join([head, *(f"  {checked.summary()}" for checked in self.coefficients)])

    def plot(self) -> Figure:
        """Time histories and loops over alpha, measured and predicted: a row for each coefficient."""
        import matplotlib.pyplot as plt

        rows = len(self.coefficients)
        figure, axes = plt.subplots(rows, 2, squeeze=False, sharex="col", figsize=(9.0, 2.8 * rows))
        angle = np.degrees(_pitch(self.measured)[0])
        for row, checked in zip(axes, self.coefficients, strict=True):
            for ax, x in zip(row, (self.measured.s, angle), strict=True):
                ax.plot(x, self.measured[checked.name], ".", ms=3, color="0.5", label="measured")
                ax.plot(x, self.predicted[checked.name], lw=1.0, label="predicted")
                ax.set_ylabel(checked.name)
        axes[0, 0].legend()
        axes[-1, 0].set_xlabel("reduced time s = 2Vt/c")
        axes[-1, 1].set_xlabel("pitch motion [deg]")
        figure.tight_layout()
        return figure


def check_prediction(
    model: ReducedModel | NonlinearModel, measured: History, *, since: float = 0.0, neglect: tuple[str, ...] = ()
) -> PredictionCheck:
    """Predict the loads of a history's motion and compare them with those it holds.

    The comparison is of the loads as they are: a wrong mean counts.

    Parameters
    ----------
    model : ReducedModel or NonlinearModel
    measured : History
        Not used to make the model, or the check says nothing.
    since : float
        Reduced time from which to compare (to skip a transient).
    neglect : tuple of str
        Inputs that may vary although the model has no response to them.

    Raises
    ------
    InputError
        If reference quantities differ, the model cannot follow the motion, or fewer than three samples are left.
    """
    used = measured.s >= since
    if np.count_nonzero(used) < 3:
        raise InputError(f"fewer than three samples at or after s = {since:g}")
    predicted = model.predict(measured, neglect=neglect)
    weights = quadrature_weights(measured.s[used])
    weights /= np.sum(weights)
    checked = []
    for name in model.outputs:
        load, error = measured[name][used], (predicted[name] - measured[name])[used]
        unsteady = load - weights @ load
        checked.append(
            CheckedCoefficient(
                name=name,
                rms=math.sqrt(weights @ error**2),
                peak=float(np.max(np.abs(error))),
                unsteady_rms=math.sqrt(weights @ unsteady**2),
                unsteady_peak=float(np.max(np.abs(unsteady))),
                damping_measured=_out_of_phase(measured, name, used),
                damping_predicted=_out_of_phase(predicted, name, used),
            )
        )
    return PredictionCheck(measured, predicted, since, tuple(checked))


def _pitch(history: History) -> tuple[Array, Array]:
    """Pitch motion theta [rad] and its rate ``d(theta)/ds``: alpha, or the attitude where alpha is held."""
    rate = history.rate[:, 1] * history.reference.length / (2.0 * history.condition.speed)
    alpha = history.alpha
    slope = np.gradient(alpha, history.s) if history.s.size > 1 else np.zeros(1)
    if np.ptp(alpha) > 1e-12:
        return alpha, rate if np.any(rate != 0.0) else slope
    steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(history.s)
    return np.concatenate([[0.0], np.cumsum(steps)]), rate


def _out_of_phase(history: History, name: str, used: NDArray[np.bool_]) -> float | None:
    theta, slope = (part[used] for part in _pitch(history))
    sizes = np.array([np.ptp(theta), np.ptp(slope)])
    if np.any(sizes <= 1e-12):
        return None
    root = np.sqrt(quadrature_weights(history.s[used]))
    columns = np.stack([np.ones_like(theta), (theta - theta.mean()) / sizes[0], slope / sizes[1]], axis=1)
    fit, _, rank, _ = np.linalg.lstsq(root[:, None] * columns, root * history[name][used], rcond=1e-9)
    return float(fit[2] / sizes[1]) if rank == 3 else None
