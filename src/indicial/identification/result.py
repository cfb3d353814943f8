"""What output error identified from a record, with its accuracy, residuals and fitted flight."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from indicial.conventions import Array, ReferenceQuantities
from indicial.derivatives import DerivativeTable
from indicial.errors import InputError
from indicial.flightsim import Trajectory
from indicial.identification.accuracy import Accuracy
from indicial.identification.estimate import Estimate, identified_table
from indicial.identification.measurement import RangeRecord
from indicial.motion import FlightCondition

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class IdentificationResult:
    """Derivatives identified by output error.

    Parameters
    ----------
    derivatives : tuple of Estimate
        About the moment reference point of `reference`.
    initial : tuple of Estimate
        State at the first station: position [m], velocity [m/s] in earth axes, Euler angles [rad], body rates [rad/s].
    accuracy : Accuracy
        Covariance of all unknowns, derivatives first; whiteness; what the record cannot tell.
    noise : ndarray
        Standard deviation of each channel, estimated or stated [m] or [rad], shape (n_channels,).
    residuals : ndarray
        Measured less fitted, shape (n_stations, n_channels).
    fitted : Trajectory
        The flight at the stations.
    record : RangeRecord
    reference : ReferenceQuantities
    start : dict
        Values of the derivatives from which the fit started.
    iterations : int
        Gauss-Newton steps taken.
    cost : tuple of float
        Negative logarithm of the likelihood (without its constant) at the start and after every step.
    """

    derivatives: tuple[Estimate, ...]
    initial: tuple[Estimate, ...]
    accuracy: Accuracy
    noise: Array
    residuals: Array
    fitted: Trajectory
    record: RangeRecord
    reference: ReferenceQuantities
    start: dict[str, float]
    iterations: int
    cost: tuple[float, ...]

    def __getitem__(self, name: str) -> Estimate:
        """One derivative or state by name.

        Raises
        ------
        InputError
            If it was not identified.
        """
        for estimate in (*self.derivatives, *self.initial):
            if estimate.name == name:
                return estimate
        raise InputError(f"{name} was not identified; identified were {', '.join(e.name for e in self.derivatives)}")

    @property
    def mach(self) -> float:
        """Mach number, mean over the stations."""
        return float(np.mean(self.fitted.mach))

    @property
    def correlation(self) -> Array:
        """Correlations of the derivatives, shape (n, n)."""
        n = len(self.derivatives)
        return self.accuracy.correlation[:n, :n]

    def table(self, condition: FlightCondition | None = None, source: str = "output error") -> DerivativeTable:
        """The derivatives as records of method ``identified``, at the mean Mach number of the flight unless told.

        Cl_0, which is no derivative, is left out.
        """
        where = FlightCondition(self.mach) if condition is None else condition
        kept = (e for e in self.derivatives if e.name != "Cl_0")
        return identified_table(kept, where, self.reference, source)

    def summary(self) -> str:
        """Derivatives with standard errors, noise, correlations worth a word, and what the record cannot tell."""
        lines = [
            f"output error at Mach {self.mach:.4g}: {len(self.record)} stations, {self.iterations} steps, "
            f"total angle up to {math.degrees(float(np.max(self.fitted.total_angle))):.3g} deg"
        ]
        lines += [f"  {estimate.summary()}" for estimate in self.derivatives]
        sizes = [
            f"{name} {1e3 * sd:.3g} mm" if name in "xyz" else f"{name} {math.degrees(sd):.3g} deg"
            for name, sd in zip(self.record.channels, self.noise, strict=True)
        ]
        lines.append(f"  noise: {', '.join(sizes)}")
        matrix = self.correlation
        for i, one in enumerate(self.derivatives):
            for j, other in enumerate(self.derivatives[:i]):
                if abs(matrix[i, j]) > 0.7:
                    lines.append(f"  {other.name} and {one.name} correlate by {matrix[i, j]:.3f}")
        return "\n".join([*lines, *(f"  {line}" for line in self.accuracy.summary().splitlines())])

    def plot(self) -> Figure:
        """Measured against fitted angles and swerve, and the residuals in standard deviations."""
        import matplotlib.pyplot as plt

        figure, axes = plt.subplots(3, 1, figsize=(9, 9), sharex=True, layout="constrained")
        x = self.record.x
        fitted = self.record.values - self.residuals
        for i, name in enumerate(self.record.channels):
            if name in ("x", "roll"):
                continue
            ax, scale = (axes[0], math.degrees(1.0)) if name in ("yaw", "pitch") else (axes[1], 1e3)
            (line,) = ax.plot(x, scale * fitted[:, i], label=f"{name}, fitted")
            ax.plot(x, scale * self.record.values[:, i], ".", color=line.get_color(), label=f"{name}, measured")
        for i, name in enumerate(self.record.channels):
            axes[2].plot(x, self.residuals[:, i] / self.noise[i], ".-", linewidth=0.5, label=name)
        axes[0].set(ylabel="angle [deg]")
        axes[1].set(ylabel="position [mm]")
        axes[2].set(xlabel="x [m]", ylabel="residual [standard deviations]")
        for ax in axes:
            ax.legend(ncols=3, fontsize="small")
        return figure
