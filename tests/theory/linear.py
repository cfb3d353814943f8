r"""Linear aerodynamics with known poles, and incompressible airfoil theory, as exact solvers.

In reduced time, with inputs u = (alpha, beta, p, q, r), rates as the reference normalises them:
``dx/ds = diag(poles) x + B u``, ``y = offset + Re(C x) + D u``, each motion solved in closed form.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import hankel2, i0e, i1e, k0e, k1e

from indicial.conventions import Array, ReferenceQuantities, flow_angles
from indicial.errors import InputError
from indicial.history import History
from indicial.motion import FlightCondition, Motion, PitchOscillation, Rates
from indicial.solver import Solver, SteadyLoads


@dataclass(frozen=True)
class LinearSystem:
    """A finite-pole linear system with a direct term, as a solver.

    Parameters
    ----------
    reference : ReferenceQuantities
    poles : ndarray
        Per unit of s, negative real parts, shape (n,); complex ones count with Re(C x).
    b, c, d : ndarray
        Shapes (n, 5), (6, n), (6, 5).
    offset : ndarray
        Loads at zero inputs, shape (6,).
    distortion : callable, optional
        Instantaneous extra loads (..., 6) from the inputs (..., 5): a known nonlinearity.
    """

    reference: ReferenceQuantities
    poles: Array
    b: Array
    c: Array
    d: Array
    offset: Array
    distortion: Callable[[Array], Array] | None = None

    def transfer(self, k: float) -> NDArray[np.complex128]:
        """``H(ik) = D + C (ik - poles)^-1 B`` for real systems (conjugate poles implied), shape (6, 5)."""

        def half(poles: Array, b: Array, c: Array) -> NDArray[np.complex128]:
            values: NDArray[np.complex128] = (c / (1j * k - poles)) @ b
            return values

        both = half(self.poles, self.b, self.c) + half(self.poles.conj(), self.b.conj(), self.c.conj())
        values: NDArray[np.complex128] = self.d + both / 2.0
        return values

    def slope(self) -> Array:
        """``H'(0)``: derivatives with respect to the reduced rates of the inputs, per ``c/2U``, shape (6, 5)."""
        return np.real(-(self.c / self.poles**2) @ self.b)

    def step(self, s: ArrayLike) -> Array:
        """Responses to unit steps of the inputs, shape s.shape + (6, 5)."""
        decay = (np.exp(np.multiply.outer(np.asarray(s, dtype=float), self.poles)) - 1.0) / self.poles
        return self.d + np.real(np.einsum("...n,jn,ni->...ji", decay, self.c, self.b))

    def _output(self, state: Array, inputs: Array) -> Array:
        loads: Array = self.offset + np.real(state @ self.c.T) + inputs @ self.d.T
        return loads if self.distortion is None else loads + self.distortion(inputs)

    def _inputs(self, condition: FlightCondition, velocity: Array, rate: Array) -> Array:
        _, alpha, beta = flow_angles(velocity)
        return np.concatenate(
            [alpha[..., None], beta[..., None], rate * self.reference.rate_scale(condition.speed)], axis=-1
        )

    def _settled(self, inputs: Array) -> Array:
        state: Array = -(self.b @ inputs) / self.poles
        return state

    def steady(self, condition: FlightCondition, rates: Rates = Rates()) -> SteadyLoads:
        inputs = self._inputs(condition, condition.velocity, rates.as_array())
        loads = self._output(self._settled(inputs), inputs)
        return SteadyLoads(loads, condition, rates, self.reference)

    def unsteady(self, condition: FlightCondition, motion: Motion, times: ArrayLike) -> History:
        t = np.asarray(times, dtype=float)
        s = 2.0 * condition.speed * t / self.reference.length
        start = self._inputs(condition, motion.velocity_before, motion.rate_before)
        inputs = self._inputs(condition, motion.velocity(t), motion.rate(t))
        constant, phasor, k = self._harmonic(condition, motion)
        forced = np.multiply.outer(np.exp(1j * k * s), self.b @ phasor / (1j * k - self.poles))
        mirrored = np.multiply.outer(np.exp(-1j * k * s), self.b @ phasor.conj() / (-1j * k - self.poles))
        driven = (forced + mirrored) / 2.0 + self._settled(constant)
        decay = np.exp(np.multiply.outer(s, self.poles))
        at_start = (
            self.b @ phasor / (1j * k - self.poles) + self.b @ phasor.conj() / (-1j * k - self.poles)
        ) / 2.0 + self._settled(constant)
        state = driven + decay * (self._settled(start) - at_start)
        return History(
            time=t,
            coefficients=self._output(state, inputs),
            velocity=motion.velocity(t),
            rate=motion.rate(t),
            before=self._output(self._settled(start), start),
            condition=condition,
            reference=self.reference,
            motion=motion.describe(),
            provenance={"solver": "finite-pole linear system"},
        )

    def _harmonic(self, condition: FlightCondition, motion: Motion) -> tuple[Array, NDArray[np.complex128], float]:
        """The inputs for t > 0 as ``constant + Re(phasor exp(iks))``."""
        if isinstance(motion, PitchOscillation):
            scale = float(self.reference.rate_scale(condition.speed)[1])
            phasor = np.zeros(5, dtype=complex)
            phasor[0] = -1j * motion.amplitude if motion.varies_alpha else 0.0
            phasor[3] = motion.amplitude * motion.omega * scale if motion.rotates else 0.0
            constant = self._inputs(condition, condition.velocity, np.zeros(3))
            return constant, phasor, motion.omega * self.reference.length / (2.0 * condition.speed)
        if motion.describe()["kind"] not in ("steady", "alpha_step", "pitch_rate_step"):
            raise InputError("the linear system solves steady states, steps and oscillations")
        return self._inputs(condition, motion.velocity(0.0), motion.rate(0.0)), np.zeros(5, dtype=complex), 1.0


def random_system(reference: ReferenceQuantities, order: int = 5, seed: int = 1) -> LinearSystem:
    """A stable system with real and complex poles between 0.05 and 1 per unit of s."""
    rng = np.random.default_rng(seed)
    poles = -rng.uniform(0.1, 1.0, order) + 1j * np.where(np.arange(order) % 2, rng.uniform(0.1, 0.5, order), 0.0)
    b, c, d = rng.normal(size=(order, 5)), rng.normal(size=(6, order)), rng.normal(size=(6, 5))
    return LinearSystem(reference, poles, b, c, d, rng.normal(size=6))


def theodorsen(k: float) -> complex:
    """``C(k) = H1/(H1 + i H0)``, Hankel functions of the second kind (Theodorsen, NACA TR 496)."""
    h0, h1 = hankel2(0, k), hankel2(1, k)
    return complex(h1 / (h1 + 1j * h0))


@lru_cache(maxsize=1)
def wagner_spectrum() -> tuple[Array, Array]:
    """Decay rates x and weights w of ``phi(s) = 1 - sum w exp(-x s)``.

    The branch-cut integral of the Laplace transform,
    ``phi = 1 - int_0^inf exp(-xs) / (x^2 [(K0 - K1)^2 + pi^2 (I0 + I1)^2]) dx``, Bessel functions of x,
    by the trapezoidal rule in log x, which converges geometrically.
    """
    log_x = np.linspace(np.log(1e-13), np.log(40.0), 601)
    x = np.exp(log_x)
    # scaled Bessel functions, K e^x and I e^-x, so the square bracket is taken out as e^2x
    bracket = (k0e(x) - k1e(x)) ** 2 * np.exp(-4.0 * x) + np.pi**2 * (i0e(x) + i1e(x)) ** 2
    return x, np.exp(-2.0 * x) / (x * bracket) * (log_x[1] - log_x[0])


def wagner(s: ArrayLike) -> Array:
    """Wagner's function phi(s), s = 2Ut/c."""
    x, w = wagner_spectrum()
    values: Array = 1.0 - np.exp(-np.multiply.outer(np.asarray(s, dtype=float), x)) @ w
    return values


APPARENT_MASS_TIME = 0.05
"""Reduced time over which the apparent-mass impulse of a step is spread, as a compressible flow would do."""


def incompressible_airfoil(reference: ReferenceQuantities, axis: float) -> LinearSystem:
    """Thin airfoil in incompressible flow about `axis` chords from the leading edge, rates per ``c/2V``.

    Circulatory loads at the quarter chord follow Wagner's function of the incidence at three quarters, so the lift's
    deficiency falls like 1/s. The apparent mass (``cl = pi alphadot c/2U`` at mid-chord), a delta function
    after a step, is spread over `APPARENT_MASS_TIME` with its area kept; that of qdot is left out.
    About the quarter chord ``Cm_alphadot = -pi/4`` and ``Cm_q = -pi/4``.
    """
    x, w = wagner_spectrum()
    fast = 1.0 / APPARENT_MASS_TIME
    incidence = np.array([1.0, 0.0, 0.0, 2.0 * (0.75 - axis), 0.0])
    b = np.concatenate([np.outer(x, incidence), [[fast, 0.0, 0.0, 0.0, 0.0]]])
    c, d = np.zeros((6, x.size + 1)), np.zeros((6, 5))
    for row, circulatory_arm, mass_arm in ((2, 1.0, 1.0), (4, axis - 0.25, axis - 0.5)):
        c[row, :-1] = 2.0 * np.pi * w * circulatory_arm
        c[row, -1] = -np.pi * fast * mass_arm
        d[row] = 2.0 * np.pi * (1.0 - w.sum()) * circulatory_arm * incidence
        d[row, 0] += np.pi * fast * mass_arm
    d[4, 3] -= np.pi / 4.0
    return LinearSystem(reference, -np.append(x, fast), b, c, d, np.zeros(6))


@dataclass(frozen=True)
class NoisySolver:
    """Another solver with independent noise on every load, of `level` times the largest change of that load."""

    solver: Solver
    level: float
    seed: int = 0

    @property
    def reference(self) -> ReferenceQuantities:
        return self.solver.reference

    def steady(self, condition: FlightCondition, rates: Rates = Rates()) -> SteadyLoads:
        return self.solver.steady(condition, rates)

    def unsteady(self, condition: FlightCondition, motion: Motion, times: ArrayLike) -> History:
        history = self.solver.unsteady(condition, motion, times)
        size = np.max(np.abs(history.coefficients - history.before), axis=0)
        noise = np.random.default_rng(self.seed).normal(size=history.coefficients.shape) * self.level * size
        return replace(history, coefficients=history.coefficients + noise)
