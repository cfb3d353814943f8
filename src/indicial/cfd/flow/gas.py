r"""The perfect gas in the solver's own units.

Inside the solver the still air has density 1 and speed of sound 1 (so its pressure is 1/gamma) and lengths are
in reference lengths c. The flow state is the primitive one, ``q = (rho, v_x, v_y, v_z, p)``, mesh axes, v the
absolute velocity (zero at infinity).
"""

from __future__ import annotations

import numpy as np

from indicial.conventions import Array

GAMMA = 1.4
"""Ratio of specific heats of the compiled kernels."""

RHO, VX, VY, VZ, P = range(5)

STILL_AIR: Array = np.array([1.0, 0.0, 0.0, 0.0, 1.0 / GAMMA])


def conservative(q: Array) -> Array:
    """``(rho, rho v, rho E)`` of primitive states ``(..., 5)``."""
    w = np.empty_like(q)
    w[..., 0] = q[..., 0]
    w[..., 1:4] = q[..., :1] * q[..., 1:4]
    w[..., 4] = q[..., 4] / (GAMMA - 1.0) + 0.5 * q[..., 0] * np.sum(q[..., 1:4] ** 2, axis=-1)
    return w


def conservative_jacobian(q: Array) -> Array:
    """``dW/dq``, shape ``(..., 5, 5)``."""
    t = np.zeros((*q.shape, 5))
    v = q[..., 1:4]
    t[..., 0, 0] = 1.0
    t[..., 1:4, 0] = v
    for i in range(1, 4):
        t[..., i, i] = q[..., 0]
    t[..., 4, 0] = 0.5 * np.sum(v * v, axis=-1)
    t[..., 4, 1:4] = q[..., :1] * v
    t[..., 4, 4] = 1.0 / (GAMMA - 1.0)
    return t
