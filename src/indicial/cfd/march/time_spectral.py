r"""The equations of periodic flows by the time-spectral method, also called harmonic balance, and their Jacobian.

A flow that repeats itself with angular frequency omega, truncated after h harmonics, is known by its states at
N = 2h + 1 equispaced instants of one period. There

    V omega sum_m D_nm W(q_m) + R(q_n; V_b(t_n), omega(t_n)) = 0,   n = 0, ..., N - 1,
    D_nm = (-1)^(n-m) / (2 sin(pi (n - m) / N)),   D_nn = 0,

D being the exact derivative, with respect to omega t, of the trigonometric polynomial of degree h through N values
(Gopinath & Jameson 2005; Hall, Thomas & Clark 2002 in the frequency domain). The N states are coupled by D alone.
The preconditioner treats the instants one by one and then, in the frequency domain, where D is diagonal, the
harmonics.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from indicial.cfd.flow.gas import conservative, conservative_jacobian
from indicial.cfd.flow.jacobian import Jacobian
from indicial.cfd.flow.residual import MeshMotion, Residual
from indicial.cfd.march.ilu import BlockILU, Pattern
from indicial.cfd.march.krylov import Operator
from indicial.cfd.march.steady import local_time_step, round_off
from indicial.conventions import Array
from indicial.errors import InputError
from indicial.solver import instants


def spectral_derivative(harmonics: int) -> Array:
    """D: values at `instants` to their derivatives with respect to the phase, exact to degree h, shape (N, N)."""
    phase = instants(harmonics)
    n = phase.size
    apart = np.subtract.outer(np.arange(n), np.arange(n))
    off = np.sin(0.5 * (phase[:, None] - phase[None, :])) + np.eye(n)
    d: Array = np.where(apart == 0, 0.0, 0.5 * (-1.0) ** apart / off)
    return d


def resample(values: Array, harmonics: int) -> Array:
    """The trigonometric polynomial through values at N = 2m + 1 instants, (N, ...), at the 2h + 1 instants of another.

    With fewer harmonics than it has, of what is left of it without its higher ones.
    """
    count, wanted = len(values), instants(harmonics).size
    spectrum = np.fft.rfft(values, axis=0)[: harmonics + 1]
    resampled: Array = np.fft.irfft(spectrum, wanted, axis=0) * (wanted / count)
    return resampled


class PeriodicResidual:
    """``F_n = V omega sum_m D_nm W(q_m) + R(q_n; motion_n)`` and its linearisation.

    Parameters
    ----------
    residual : Residual
    motions : sequence of MeshMotion
        At the N = 2h + 1 instants.
    omega : float
        Angular frequency, solver units.
    """

    def __init__(self, residual: Residual, motions: Sequence[MeshMotion], omega: float) -> None:
        self.residual = residual
        self.motions = tuple(motions)
        self.omega = omega
        if len(self.motions) % 2 == 0:
            raise InputError(f"a periodic flow at {len(self.motions)} instants: their number must be odd, 3 or more")
        self.round_off = 0.0
        """What double precision leaves of F at the last states evaluated."""
        self._rate: Array = omega * spectral_derivative(len(self.motions) // 2)

    def __call__(self, q: Array) -> Array:
        """F, shape (N, nc, 5)."""
        f = self.time_derivative(self.residual.grid.volume[:, None] * conservative(q))
        left = []
        for n, motion in enumerate(self.motions):
            f[n] += self.residual(q[n], motion)
            left.append(round_off(self.residual))
        self.round_off = float(np.linalg.norm(left))
        return f

    def time_derivative(self, w: Array) -> Array:
        """``dw/dt`` of values w at the instants, (N, ...)."""
        derivative: Array = np.tensordot(self._rate, w, axes=1)
        return derivative

    def time_step(self, q: Array) -> Array:
        """Local step of CFL 1 at each instant, shape (N, nc)."""
        grid = self.residual.grid
        return np.stack([local_time_step(grid, q[n], motion) for n, motion in enumerate(self.motions)])

    def linearise(self, q: Array, damping: Array) -> PeriodicJacobian:
        """dF/dq with a pseudo-time term, `damping` (N, nc) the inverse of its step."""
        jacobians = [Jacobian(self.residual, q[n], motion) for n, motion in enumerate(self.motions)]
        mass = self.residual.grid.volume[:, None, None] * conservative_jacobian(q)
        return PeriodicJacobian(self, jacobians, mass, damping)


class PeriodicJacobian:
    """dF/dq plus a pseudo-time term at N states: one Jacobian for each instant, coupled by the time derivative.

    Parameters
    ----------
    periodic : PeriodicResidual
    jacobians : list of Jacobian
    mass : ndarray
        ``V dW/dq`` at the instants (N, nc, 5, 5).
    damping : ndarray
        Inverse of the pseudo-time step (N, nc).
    """

    def __init__(self, periodic: PeriodicResidual, jacobians: list[Jacobian], mass: Array, damping: Array) -> None:
        self._periodic = periodic
        self._jacobians = jacobians
        self._mass = mass
        self._damping = damping
        self.products = 0

    def apply(self, x: Array) -> Array:
        """``(damping V dW/dq + dF/dq) x``, shape (N, nc, 5)."""
        w = np.einsum("ncij,ncj->nci", self._mass, x)
        y: Array = self._periodic.time_derivative(w) + self._damping[..., None] * w
        for n, jacobian in enumerate(self._jacobians):
            y[n] += jacobian.apply(x[n])
        self.products += len(self._jacobians)
        return y

    def preconditioner(self, pattern: Pattern) -> Operator:
        """An approximate inverse in two strokes: each instant by itself, then each harmonic of what is left.

        The first inverts J of every instant without the coupling, the second ``i n omega V E + J`` of the means over
        the period: shocks that move need the one; the far field, where waves cross a cell in a good part of the
        period, the other.
        """
        count = len(self._jacobians)
        extra = self._damping[..., None, None] * self._mass
        mean = np.zeros((len(pattern.indices), 5, 5))
        at_instants = []
        for n, jacobian in enumerate(self._jacobians):
            blocks = jacobian.compact_blocks(extra[n], pattern.slots, pattern.diagonal, len(pattern.indices))
            mean += blocks / count
            at_instants.append(BlockILU(pattern, blocks))
        mean_mass = self._mass.mean(axis=0)
        of_harmonics = [BlockILU(pattern, mean.copy())]
        for n in range(1, count // 2 + 1):
            shifted = mean.astype(complex)
            shifted[pattern.diagonal] += 1j * n * self._periodic.omega * mean_mass
            of_harmonics.append(BlockILU(pattern, shifted))

        def solve(b: Array) -> Array:
            x = np.stack([ilu.solve(b[n]) for n, ilu in enumerate(at_instants)])
            spectrum = np.fft.rfft(b - self.apply(x), axis=0)
            spectrum[0] = of_harmonics[0].solve(spectrum[0].real.copy())
            for n in range(1, len(of_harmonics)):
                spectrum[n] = of_harmonics[n].solve(spectrum[n])
            x += np.fft.irfft(spectrum, count, axis=0)
            return x

        return solve
