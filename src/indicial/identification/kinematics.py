r"""The motion that accelerometers and gyros imply, whatever the forces: rigid-body kinematics, integrated.

    udot = r v - q w - g sin(theta) + ax               phidot   = p + tan(theta) (q sin(phi) + r cos(phi))
    vdot = p w - r u + g cos(theta) sin(phi) + ay      thetadot = q cos(phi) - r sin(phi)
    wdot = q u - p v + g cos(theta) cos(phi) + az      psidot   = (q sin(phi) + r cos(phi))/cos(theta)
    hdot = u sin(theta) - v sin(phi) cos(theta) - w cos(phi) cos(theta)

by the classical Runge-Kutta method over the samples, inputs linear between them; for many sets of unknowns at once.
Source: Klein & Morelli, "Aircraft System Identification" (2006), sec. 10.2 and 10.3.
"""

from __future__ import annotations

import numba
import numpy as np

from indicial.conventions import Array, Index


@numba.njit(cache=True)
def _rate(state: Array, imu: Array, g: float, out: Array) -> None:
    u, v, w, phi, theta, _, _ = state
    ax, ay, az, p, q, r = imu
    sp, cp, st, ct = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    out[0] = r * v - q * w - g * st + ax
    out[1] = p * w - r * u + g * ct * sp + ay
    out[2] = q * u - p * v + g * ct * cp + az
    turn = q * sp + r * cp
    out[3] = p + st / ct * turn
    out[4] = q * cp - r * sp
    out[5] = turn / ct
    out[6] = u * st - v * sp * ct - w * cp * ct


@numba.njit(cache=True)
def integrate(time: Array, imu: Array, starts: Array, biases: Array, scales: Array, g: float) -> Array:
    """Motions of several sets of unknowns.

    Parameters
    ----------
    time : ndarray
        [s], shape (n,).
    imu : ndarray
        Measured ax, ay, az [m/s^2], p, q, r [rad/s], shape (n, 6).
    starts : ndarray
        u, v, w [m/s], phi, theta, psi [rad], altitude [m] at the first sample, shape (sets, 7).
    biases, scales : ndarray
        Of the IMU: measured = scale times true, plus bias; shape (sets, 6).
    g : float
        [m/s^2].

    Returns
    -------
    ndarray
        Shape (sets, n, 7).
    """
    sets, n = starts.shape[0], time.size
    found = np.empty((sets, n, 7))
    k1, k2, k3, k4 = np.empty(7), np.empty(7), np.empty(7), np.empty(7)
    for s in range(sets):
        state = starts[s].copy()
        found[s, 0] = state
        here = (imu[0] - biases[s]) / scales[s]
        for i in range(1, n):
            there = (imu[i] - biases[s]) / scales[s]
            middle = 0.5 * (here + there)
            h = time[i] - time[i - 1]
            _rate(state, here, g, k1)
            _rate(state + 0.5 * h * k1, middle, g, k2)
            _rate(state + 0.5 * h * k2, middle, g, k3)
            _rate(state + h * k3, there, g, k4)
            state = state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
            found[s, i] = state
            here = there
    return found


@numba.njit(cache=True)
def block_responses(time: Array, imu: Array, base: Array, g: float, edges: Index, size: Array) -> Array:
    """Changes of the motion, per unit, with an offset of each IMU channel over each block of samples.

    Parameters
    ----------
    time, imu : ndarray
        As `integrate`, errors taken out, shapes (n,), (n, 6).
    base : ndarray
        The motion of `imu`, shape (n, 7).
    g : float
        [m/s^2].
    edges : ndarray of int
        First sample of each block, and one past the last, shape (blocks + 1,).
    size : ndarray
        Offset that is tried for each channel, shape (6,).

    Returns
    -------
    ndarray
        Shape (blocks, 6, n, 7); 0 before the block.
    """
    blocks, n = edges.size - 1, time.size
    none, one = np.zeros((1, 6)), np.ones((1, 6))
    found = np.zeros((blocks, 6, n, 7))
    for b in range(blocks):
        first = max(edges[b] - 1, 0)
        begin = base[first].copy().reshape(1, 7)
        for c in range(6):
            changed = imu[first:].copy()
            changed[edges[b] - first : edges[b + 1] - first, c] += size[c]
            found[b, c, first:] = (integrate(time[first:], changed, begin, none, one, g)[0] - base[first:]) / size[c]
    return found
