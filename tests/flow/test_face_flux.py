"""Face fluxes against a plain second implementation: textbook formulas, a face at a time, branch by branch."""

import numpy as np
import pytest

from indicial.cfd.flow import Grid, MeshMotion, Residual
from indicial.cfd.flow.flux import hllc
from indicial.cfd.flow.gas import GAMMA, conservative
from indicial.cfd.flow.reconstruction import SATURATION
from indicial.cfd.mesh import box_mesh
from indicial.conventions import ReferenceQuantities

MOTION = MeshMotion(np.array([-2.0, 0.3, 0.5]), np.array([0.3, -0.5, 0.2]))


def flux_of(q: np.ndarray, n: np.ndarray, ug: float) -> np.ndarray:
    un = q[1:4] @ n
    return conservative(q) * (un - ug) + q[4] * np.array([0.0, *n, un])


def textbook_hllc(left: np.ndarray, right: np.ndarray, n: np.ndarray, ug: float) -> np.ndarray:
    """Toro's book: F_K + S_K (W*_K - W_K), in a frame that moves with the face and back again."""
    a, b = left.copy(), right.copy()
    a[1:4] -= ug * n
    b[1:4] -= ug * n
    root = np.sqrt([a[0], b[0]])
    enthalpy = [GAMMA / (GAMMA - 1.0) * q[4] / q[0] + 0.5 * q[1:4] @ q[1:4] for q in (a, b)]
    v = (root[0] * a[1:4] + root[1] * b[1:4]) / root.sum()
    h = root @ enthalpy / root.sum()
    # the tangential jump is no part of a plane wave
    tangential = (b[1:4] - a[1:4]) - ((b - a)[1:4] @ n) * n
    h -= 0.5 * root[0] * root[1] / root.sum() ** 2 * tangential @ tangential
    c = np.sqrt((GAMMA - 1.0) * (h - 0.5 * v @ v))
    s_a = min(a[1:4] @ n - np.sqrt(GAMMA * a[4] / a[0]), v @ n - c)
    s_b = max(b[1:4] @ n + np.sqrt(GAMMA * b[4] / b[0]), v @ n + c)
    if s_a >= 0.0:
        f = flux_of(a, n, 0.0)
    elif s_b <= 0.0:
        f = flux_of(b, n, 0.0)
    else:
        ua, ub = a[1:4] @ n, b[1:4] @ n
        ma, mb = a[0] * (s_a - ua), b[0] * (s_b - ub)
        s_m = (b[4] - a[4] + ma * ua - mb * ub) / (ma - mb)
        q, s, u = (a, s_a, ua) if s_m >= 0.0 else (b, s_b, ub)
        star = np.empty(5)
        star[0] = 1.0
        star[1:4] = q[1:4] + (s_m - u) * n
        star[4] = conservative(q)[4] / q[0] + (s_m - u) * (s_m + q[4] / (q[0] * (s - u)))
        star *= q[0] * (s - u) / (s - s_m)
        f = flux_of(q, n, 0.0) + s * (star - conservative(q))
    # W in the frame at rest: momentum gains rho u_g n, energy u_g n.(rho v) + rho u_g^2 / 2
    out = f.copy()
    out[1:4] += f[0] * ug * n
    out[4] += ug * (f[1:4] @ n) + 0.5 * ug**2 * f[0]
    return out


def random_states(count: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    q = rng.uniform(0.3, 2.0, (count, 5))
    q[:, 1:4] = rng.uniform(-2.0, 2.0, (count, 3))
    return q


def test_the_flux_is_the_textbook_one_in_all_four_regions_of_the_wave_fan() -> None:
    left, right = random_states(400, 1), random_states(400, 2)
    rng = np.random.default_rng(3)
    regions = set()
    for a, b in zip(left, right, strict=True):
        n = rng.standard_normal(3)
        n /= np.linalg.norm(n)
        ug = rng.uniform(-2.0, 2.0)
        exact = textbook_hllc(a, b, n, ug)
        assert np.array(hllc(*a, *b, *n, ug)) == pytest.approx(exact, rel=1e-12, abs=1e-12)
        upwind = [np.allclose(exact, flux_of(q, n, ug), rtol=1e-10) for q in (a, b)]
        regions.add((*upwind, exact[0] > 0.0))
    assert regions == {(True, False, True), (False, True, False), (False, False, True), (False, False, False)}


def saturated(x: float, q: float) -> float:
    return x / np.sqrt(1.0 + (x / (SATURATION * q)) ** 2)


def face_state(own: np.ndarray, other: np.ndarray, g: np.ndarray, r: np.ndarray, d: np.ndarray) -> np.ndarray:
    b = other - own
    a = 2.0 * g @ d - b
    eps = np.linalg.norm(d) ** 3
    psi = 2.0 * (a * b + eps) / (a**2 + b**2 + 2.0 * eps)
    x = g @ r - (1.0 - psi) * (r @ d) / (d @ d) * (g @ d)
    x[0], x[4] = saturated(x[0], own[0]), saturated(x[4], own[4])
    return own + x


@pytest.mark.parametrize("shape", [(3, 4, 3), (8, 1, 4), (2, 1, 1)])
def test_interior_fluxes_are_those_of_a_plain_loop_whatever_the_number_of_faces(shape: tuple[int, int, int]) -> None:
    grid = Grid.from_mesh(box_mesh(shape, skew="random"), ReferenceQuantities(1.0, 1.0, (0.3, 0.2, 0.1)))
    residual = Residual(grid)
    q = random_states(grid.n_cells, 4)
    residual(q, MOTION)
    g = residual.gradient
    for f in range(grid.n_interior):
        i, j = grid.owner[f], grid.neighbour[f]
        d = grid.to_owner[f] - grid.to_neighbour[f]
        left = face_state(q[i], q[j], g[i], grid.to_owner[f], d)
        right = face_state(q[j], q[i], g[j], grid.to_neighbour[f], -d)
        ug = grid.normal[f] @ MOTION.velocity + grid.moment[f] @ MOTION.omega / grid.area[f]
        exact = textbook_hllc(left, right, grid.normal[f], ug) * grid.area[f]
        assert residual.face_flux[f] == pytest.approx(exact, rel=1e-11, abs=1e-12 * np.max(np.abs(exact)))
