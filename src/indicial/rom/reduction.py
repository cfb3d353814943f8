r"""From spaces of snapshots to stable models of few states, by small dense algebra.

1. `interpolate`: all states that the snapshots have. With factors ``Z Z^T`` of the Gramians of the flow, the singular
   vectors of ``Z_y^T E Z_x`` give trial and test spaces (balanced proper orthogonal decomposition: Willcox and
   Peraire, AIAA J. 40, 2002).
2. `stabilise`: the part of that whose poles are stable.
3. `nest`: its states in coordinates whose norm is the energy that the loads still have to see,
   ``A + A^T = -C^T C``. In them Galerkin's projection on any directions is stable. The first directions
   are the moments ``A^{-1} B`` and ``A^{-2} B``, which keep H(0) and H'(0); then those that motions of the band excite
   most, in that energy.
4. `impose`: the flow's own H(0) and H'(0), which differ from those kept by what unstable poles had of them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import eigvals, schur, solve_continuous_lyapunov, solve_sylvester

from indicial.conventions import Array
from indicial.errors import DivergenceError, InputError
from indicial.rom.model import ComplexArray
from indicial.rom.snapshots import Operators

_RANK = 1e-13
_HANKEL_RANK = 1e-11
_EXACT = 1e-9


@dataclass(frozen=True)
class Reduced:
    """``dz/ds = A z + B u``, ``y = C z + D u``."""

    a: Array
    b: Array
    c: Array
    d: Array

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.a)

    def forward(self, k: Array) -> ComplexArray:
        """``(ik - A)^{-1} B``, shape (n_k, order, n_inputs)."""
        return np.asarray(np.linalg.solve(self._shifted(k), self.b.astype(complex)))

    def adjoint(self, k: Array) -> ComplexArray:
        """``(ik - A)^{-T} C^T``, shape (n_k, order, n_outputs)."""
        return np.asarray(np.linalg.solve(self._shifted(k).transpose(0, 2, 1), self.c.T.astype(complex)))

    def transfer(self, k: Array) -> ComplexArray:
        """``D + C (ik - A)^{-1} B``, shape (n_k, n_outputs, n_inputs)."""
        return np.asarray(self.d + self.c @ self.forward(k))

    def moments(self) -> Array:
        """``-A^{-1} B`` and ``-A^{-2} B``, whose loads are ``H(0) - D`` and ``H'(0)``; shape (order, 2 n_inputs)."""
        once = np.linalg.solve(self.a, self.b)
        return -np.hstack([once, np.linalg.solve(self.a, once)])

    def within(self, test: Array, trial: Array) -> Reduced:
        """The model projected on the columns of `trial` along those of `test`, ``test^T trial = 1``."""
        return Reduced(test.T @ self.a @ trial, test.T @ self.b, self.c @ trial, self.d)

    def _shifted(self, k: Array) -> ComplexArray:
        return np.asarray(1j * k[:, None, None] * np.eye(self.order) - self.a)


@dataclass(frozen=True)
class Interpolant(Reduced):
    """A reduced model with the spaces it lives in: ``x = Q_x right z``, adjoint ``y = Q_y left v``."""

    left: Array
    right: Array


@dataclass(frozen=True)
class Nested:
    """A stable model, and the directions in which to cut it down.

    Parameters
    ----------
    model : Reduced
        With ``A + A^T = -C^T C`` for outputs scaled.
    directions : ndarray
        Orthonormal, most important first, shape (order, order).
    hankel : ndarray
        Hankel singular values, inputs and outputs scaled.
    """

    model: Reduced
    directions: Array
    hankel: Array

    @property
    def order(self) -> int:
        """Number of states before any cut."""
        return self.model.order

    def truncate(self, order: int) -> Reduced:
        """The model of `order` states; stable, with H(0) and H'(0) kept from two states per input on."""
        kept = self.directions[:, :order]
        return self.model.within(kept, kept)


def interpolate(flow: Operators, forward_factor: Array, adjoint_factor: Array) -> Interpolant:
    """All states that the snapshots have, from factors of the Gramians in the bases of `flow`.

    Raises
    ------
    InputError
        If no load sees what any input does.
    """
    left, singular, right = np.linalg.svd(adjoint_factor.T @ flow.mass @ forward_factor)
    singular = singular[singular > _RANK * np.max(singular, initial=0.0)]
    if singular.size == 0:
        raise InputError("projection: the flow's loads do not see what its inputs do, there is nothing to model")
    root = np.sqrt(singular)
    test = adjoint_factor @ left[:, : root.size] / root
    trial = forward_factor @ right[: root.size].T / root
    return Interpolant(
        a=-test.T @ flow.jacobian @ trial,
        b=-test.T @ flow.b,
        c=flow.c @ trial,
        d=flow.d,
        left=test,
        right=trial,
    )


def stabilise(full: Interpolant, k: Array, scale: Array) -> tuple[Reduced, ComplexArray]:
    """The stable part of an interpolant, or of its leading states where that is nearer to it over the band.

    Parameters
    ----------
    full : Interpolant
    k : ndarray
        Over the band.
    scale : ndarray
        What each channel's error is relative to, shape (n_outputs, n_inputs).

    Returns
    -------
    Reduced
    discarded : ndarray
        Unstable poles that were left out.

    Raises
    ------
    DivergenceError
        If no pole is stable.
    """
    target = full.transfer(k)
    best, least = None, np.inf
    for order in range(full.order, full.order // 2, -1):
        kept = np.eye(full.order, order)
        stable, discarded = _stable_part(full.within(kept, kept))
        if stable.order == 0:
            continue
        error = float(np.max(np.abs(stable.transfer(k) - target) / scale))
        if error < least:
            best, least = (stable, discarded), error
        if discarded.size == 0:  # fewer states would only lose more
            break
    if best is None:
        raise DivergenceError("projection: no pole is stable; is the flow's steady state?")
    return best


def nest(stable: Reduced, k_max: float, scale: Array) -> Nested:
    r"""A stable model with the directions that matter to motions of a band.

    The motions are white noise through ``1/(1 + s/k_max)``.

    Parameters
    ----------
    stable : Reduced
    k_max : float
    scale : ndarray
        Size of each channel of H, shape (n_outputs, n_inputs): the loads count relative to it.
    """
    outputs = np.max(scale, axis=1)
    inputs = np.max(scale / outputs[:, None], axis=0)
    excited = gramian_factor(stable.a, stable.b / inputs)
    seen = gramian_factor(stable.a.T, (stable.c / outputs[:, None]).T)
    left, hankel, right = np.linalg.svd(seen.T @ excited)
    hankel = hankel[hankel > _HANKEL_RANK * np.max(hankel, initial=0.0)]
    # the observability Gramian is the identity, the other one hankel^2
    normal = stable.within(seen @ left[:, : hankel.size], excited @ right[: hankel.size].T / hankel)
    moments = normal.moments()
    first = np.linalg.qr(moments / np.maximum(np.linalg.norm(moments, axis=0), 1e-300))[0]
    others = np.eye(normal.order) - first @ first.T
    ranked = np.linalg.eigh(others @ _band_gramian(normal, inputs, k_max) @ others)[1][:, ::-1]
    directions = np.linalg.qr(np.hstack([first, ranked]))[0]
    return Nested(normal, directions, hankel)


def impose(model: Reduced, static: Array, rate: Array) -> Reduced | None:
    """The same poles with ``H(0)`` and ``H'(0)`` as given, by the least change of C; None if the states are too few."""
    moments = model.moments()
    wanted = np.hstack([static - model.d, rate])
    missing = wanted - model.c @ moments
    size = np.maximum(np.linalg.norm(moments, axis=0), 1e-300)
    change = np.linalg.lstsq((moments / size).T, (missing / size).T, rcond=1e-13)[0].T
    if np.any(np.abs(missing - change @ moments) > _EXACT * np.max(np.abs(wanted))):
        return None
    return replace(model, c=model.c + change)


def _stable_part(model: Reduced) -> tuple[Reduced, ComplexArray]:
    """The part of a model that decays, and the poles of the rest."""
    triangular, turn, n = schur(model.a, sort="lhp")
    turned = Reduced(triangular, turn.T @ model.b, model.c @ turn, model.d)
    if n == model.order:
        return turned, np.zeros(0, dtype=np.complex128)
    stable, unstable = triangular[:n, :n], triangular[n:, n:]
    # turned once more, so that the states that decay do not see the others
    coupling = solve_sylvester(stable, -unstable, -triangular[:n, n:])
    part = Reduced(stable, turned.b[:n] - coupling @ turned.b[n:], turned.c[:, :n], model.d)
    return part, np.asarray(eigvals(unstable), dtype=np.complex128)


def _band_gramian(model: Reduced, inputs: Array, k_max: float) -> Array:
    """Covariance of the states under motions of the band, shape (order, order)."""
    n, m = model.b.shape
    low_pass = np.block([[model.a, model.b / inputs], [np.zeros((m, n)), -k_max * np.eye(m)]])
    noise = np.vstack([np.zeros((n, m)), k_max * np.eye(m)])
    return _gramian(low_pass, noise)[:n, :n]


def _gramian(a: Array, b: Array) -> Array:
    """P of ``A P + P A^T = -B B^T``."""
    p = solve_continuous_lyapunov(a, -b @ b.T)
    return np.asarray((p + p.T) / 2.0)


def gramian_factor(a: Array, b: Array) -> Array:
    """L with ``P = L L^T`` and ``A P + P A^T = -B B^T``, for A stable."""
    values, vectors = np.linalg.eigh(_gramian(a, b))
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))
