r"""The linearised lattice as an explicit state space, step by step.

The states are the circulations that the panels of each strip summed to in the last n steps, which is all that the wake
knows, and the loads of the changes of circulation at the last two. The wake is frozen. The output is what the march
gives, step for step: rings with means over steps, differences of second order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from indicial.cfd.lattice.linear import ComplexArray, LinearLattice
from indicial.conventions import COEFFICIENTS, Array
from indicial.errors import InputError
from indicial.frequency import reduced_frequencies

if TYPE_CHECKING:
    import control

LARGEST = 6000
"""Number of states up to which dense matrices are made."""


@dataclass(frozen=True)
class DiscreteLattice:
    """``x(n+1) = A x(n) + B u(n)``, ``loads(n) - baseline = C x(n) + D u(n)``.

    Parameters
    ----------
    a, b, c, d : ndarray
        Shapes (n, n), (n, n_inputs), (6, n), (6, n_inputs).
    step : float
        Reduced time ``2V dt/c`` from one row to the next.
    inputs : tuple of str
        Of alpha, beta [rad] and p, q, r (``q c/2V``, ``p b/2V``, ``r b/2V``).
    baseline : ndarray
        (CA, CY, CN, Cl, Cm, Cn) of the steady flight, shape (6,).
    """

    a: Array
    b: Array
    c: Array
    d: Array
    step: float
    inputs: tuple[str, ...]
    baseline: Array

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.a)

    def frequency_response(self, k: ArrayLike) -> ComplexArray:
        """``C (z - A)^{-1} B + D`` at ``z = exp(ik step)``, shape (n_k, 6, n_inputs)."""
        found = []
        for one in reduced_frequencies(k):
            z = np.exp(1j * one * self.step)
            found.append(self.c @ np.linalg.solve(z * np.eye(self.order) - self.a, self.b.astype(complex)) + self.d)
        return np.array(found, dtype=complex).reshape(-1, 6, len(self.inputs))

    def respond(self, inputs: Array) -> Array:
        """Loads less the baseline (n, 6) under inputs (n, n_inputs) from rest."""
        state, out = np.zeros(self.order), np.empty((len(inputs), 6))
        for n, u in enumerate(inputs):
            out[n] = self.c @ state + self.d @ u
            state = self.a @ state + self.b @ u
        return out

    def system(self) -> control.StateSpace:
        """As a `control.StateSpace` with `step` for its time step, inputs and outputs named."""
        import control

        names: dict[str, Any] = {"inputs": list(self.inputs), "outputs": list(COEFFICIENTS)}
        return control.ss(self.a, self.b, self.c, self.d, self.step, **names)

    def summary(self) -> str:
        """One line."""
        return f"discrete vortex lattice: {self.order} states, step {self.step:g}, inputs {', '.join(self.inputs)}"


def discrete(
    linear: LinearLattice,
    step: float,
    length: float,
    inputs: Sequence[str] = ("alpha", "q", "beta", "p", "r"),
) -> DiscreteLattice:
    """The linearised lattice with a frozen wake, in steps.

    Parameters
    ----------
    linear : LinearLattice
    step : float
        Reduced time of a step.
    length : float
        Reduced time for which the wake remembers; what is older counts as its oldest value.

    Raises
    ------
    InputError
        If the wake is shed and the flight has lift, or there would be more than `LARGEST` states.
    """
    if linear.shed and np.max(np.abs(linear.circulation)) > 1e-9 * linear.condition.speed * linear.reference.length:
        raise InputError("a lifting flight's state space needs the wake 'frozen' in the settings, not 'shed'")
    if not (np.isfinite(step) and step > 0.0 and np.isfinite(length) and length >= 2.0 * step):
        raise InputError(f"step {step} and length {length}: both must be positive, with at least two steps")
    lattice = linear.instant.influence.lattice
    rows, strips, p = int(np.ceil(length / step)), lattice.n_strips, lattice.n_panels
    order = rows * strips + 12
    if order > LARGEST:
        raise InputError(f"{rows} steps of {strips} strips are {order} states, more than {LARGEST}: take fewer")
    share = _shares(linear.rings, rows, step * linear.half_chord)
    wash = np.einsum("ris,rps->ips", share, linear.wash)
    lift = np.einsum("ris,rks->iks", share, linear.lift)
    wind = np.stack([linear.wind(name, 0.0, displaced=False).real for name in inputs], axis=-1)
    normalwash = np.einsum("pci,pc->pi", wind[:p], lattice.normal)
    matrix = linear.bound_wash.copy()
    matrix[:, lattice.trailing] += wash[0]
    to_states = -np.linalg.solve(matrix, np.concatenate(wash[1:], axis=1))
    to_inputs = -np.linalg.solve(matrix, normalwash)
    per_time = linear.condition.speed / (linear.half_chord * step)
    rates = linear.loads.rate * per_time
    now = linear.loads.circulation.copy()
    now[:, lattice.trailing] += lift[0]
    a, b = np.zeros((order, order)), np.zeros((order, len(inputs)))
    c, d = np.zeros((6, order)), np.zeros((6, len(inputs)))
    shed, wake = slice(0, strips), slice(0, rows * strips)
    last, before = slice(order - 12, order - 6), slice(order - 6, order)
    a[shed, wake], b[shed] = to_states[lattice.trailing], to_inputs[lattice.trailing]
    a[strips : rows * strips, : (rows - 1) * strips] = np.eye((rows - 1) * strips)
    a[last, wake], b[last] = rates @ to_states, rates @ to_inputs
    a[before, last] = np.eye(6)
    c[:, wake] = (now + 1.5 * rates) @ to_states + np.concatenate(lift[1:], axis=1)
    c[:, last], c[:, before] = -2.0 * np.eye(6), 0.5 * np.eye(6)
    d[:] = (now + 1.5 * rates) @ to_inputs + np.einsum("kse,sei->ki", linear.loads.wind, wind[p:])
    return DiscreteLattice(a, b, c, d, step, tuple(inputs), linear.baseline)


def _shares(rings: Array, rows: int, length: float) -> Array:
    """What each ring and, last, the tail has of the circulation of each of the last steps, shape (n + 1, rows + 1, S).

    Means of what is linear between distances 0, 1, ... `rows` times a `length` [m], and constant beyond.
    """

    def below(place: Array) -> Array:
        """Integral of each step's hat function from far ahead up to a place in steps, shape (..., rows + 1, S)."""
        u = np.clip(place[:, None, :] - np.arange(rows + 1)[None, :, None], -1.0, 1.0)
        found = np.where(u < 0.0, 0.5 * (1.0 + u) ** 2, 1.0 - 0.5 * (1.0 - u) ** 2)
        beyond = np.maximum(place - rows, 0.0)
        found[:, -1] = np.where(beyond > 0.0, 0.5 + beyond, found[:, -1])
        return np.asarray(found)

    places = rings / length
    thickness = np.diff(places, axis=0)
    filled = thickness > 0.0
    mean = np.diff(below(places), axis=0) / np.where(filled, thickness, 1.0)[:, None, :]
    out = np.concatenate([mean, np.zeros((1, rows + 1, rings.shape[1]))])
    out[0] = 0.0
    out[0, 0] = 1.0
    out[-1, -1] = 1.0
    return out
