r"""JSBSim: an aerodynamics file and a system file with the lag states.

JSBSim runs its systems before it knows the new flow angles: at frame k+1 a system still sees the motion of frame k. So
the system carries what the past alone decides, ``xi = P x_k + alpha v_k``, and the aerodynamics add what the present
adds, ``x = xi + beta v``, with the factors of `indicial.rom.recurrence`. The two together are the exact
discretisation, with no frame of delay; and since the factors are computed at every frame from ``simulation/dt`` and the
speed, nothing is frozen at loading, as the coefficients of JSBSim's own ``lag_filter`` are.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import ArrayLike

from indicial.conventions import COEFFICIENTS, Array
from indicial.errors import InputError
from indicial.files import write_text
from indicial.rom.export.portable import MEANING, Portable
from indicial.rom.signals import ANGLES
from indicial.rom.state_space import StateSpaceModel

FOOT = 0.3048
"""[m]"""

_RATES = {name: f"<p>velocities/{name}-aero-rad_sec</p>" for name in "pqr"}
_AXES = {"CA": "AXIAL", "CY": "SIDE", "CN": "NORMAL", "Cl": "ROLL", "Cm": "PITCH", "Cn": "YAW"}

_SPEED = "<max><p>velocities/vt-fps</p><v>1</v></max>"  # JSBSim begins at rest before it has its initial conditions

_Complex = tuple[str, str]
"""Real and imaginary part."""


StaticCurves = Mapping[str, tuple[ArrayLike, ArrayLike]]
"""Coefficient, and its settled values over alpha [rad]: (alpha, values), at beta and rates of the model's condition."""


def export_jsbsim(model: StateSpaceModel, path: Path, *, static: StaticCurves | None = None) -> tuple[Path, ...]:
    """``NAME.xml``, for ``<aerodynamics file="NAME"/>``, and ``NAME_memory.xml``, for ``<system file="NAME_memory"/>``.

    Properties: ``indicial/CA`` to ``indicial/Cn``, the coefficients. The states are at rest under the motion of the
    moment whenever JSBSim runs without time going on (initial conditions, trim).

    Parameters
    ----------
    static : mapping, optional
        Curves, written as tables, in the place of ``C_0 + H_alpha(0) (alpha - alpha_0)`` of the coefficients named: a
        static curve that bends, with the linear memory about it. Linear between its points, constant beyond.

    Raises
    ------
    InputError
        If the model has no modal form, or a curve is none of its own.
    """
    portable, curves = Portable.of(model), _checked(model, static or {})
    beside = path.with_name(f"{path.stem}_memory.xml")
    write_text(path, _aerodynamics(portable, beside.stem, curves))
    write_text(beside, _system(portable, beside.stem))
    return path, beside


def _checked(model: StateSpaceModel, static: StaticCurves) -> dict[str, Array]:
    """The curves as arrays of shape (n, 2)."""
    curves = {}
    for name, (alpha, values) in static.items():
        if name not in COEFFICIENTS or "alpha" not in model.inputs:
            raise InputError(
                f"no static curve of {name!r} over alpha: the model has {', '.join(model.inputs)} as inputs"
            )
        x, y = np.asarray(alpha, dtype=float), np.asarray(values, dtype=float)
        if (
            x.ndim != 1
            or x.size < 2
            or x.shape != y.shape
            or not np.all(np.diff(x) > 0.0)
            or not np.all(np.isfinite(y))
        ):
            raise InputError(f"the static curve of {name} needs two or more increasing alpha, a finite value for each")
        curves[name] = np.stack([x, y], axis=1)
    return curves


def _aerodynamics(portable: Portable, memory: str, curves: dict[str, Array]) -> str:
    reference = portable.model.reference
    area, lengths = reference.area / FOOT**2, (1.0, 1.0, 1.0, *(reference.moment_lengths / FOOT))
    modes = portable.modes
    lines = _inputs(portable, "now", "function")
    for i in range(modes.poles.size):
        v = _driven(portable, i, "now")
        held = _times((_p(f"beta-{i}-re"), _p(f"beta-{i}-im")), v, i < modes.real)
        lines += _define("function", f"x-{i}-re", _sum(_p(f"xi-{i}-re"), held[0]))
        if i >= modes.real:
            lines += _define("function", f"x-{i}-im", _sum(_p(f"xi-{i}-im"), held[1]))
    for j, name in enumerate(COEFFICIENTS):
        direct, terms = modes.d[j].copy(), [_v(portable.model.baseline[j])]
        if name in curves:
            m = portable.model.inputs.index("alpha")
            direct[m] = np.real(np.sum(modes.c[j] * modes.b[:, m] / modes.poles))  # D - H(0)
            terms = [_table("indicial/now-alpha", curves[name])]
        terms += [_product(_v(gain), _p(f"now-{m}")) for m, gain in enumerate(direct) if gain]
        for i, weight in enumerate(modes.c[j]):
            if weight:
                terms.append(_product(_v(weight.real), _p(f"x-{i}-re")))
            if weight.imag and i >= modes.real:
                terms.append(_product(_v(-weight.imag), _p(f"x-{i}-im")))
        lines += _define("function", name, _sum(*terms), MEANING[name])
    for (name, axis), length in zip(_AXES.items(), lengths, strict=True):
        load = _product("<p>aero/qbar-psf</p>", _v(area), *([_v(length)] if length != 1.0 else []), _p(name))
        lines += [f'<axis name="{axis}">', *_define("function", f"load-{name}", load), "</axis>"]
    notes = [
        *portable.notes(),
        f'Needs <system file="{memory}"/> in the same aircraft. Reference area and lengths are those above, whatever',
        "<metrics> says; its AERORP must be the moment reference point (structural axes: x aft, y right, z up).",
        "The flow angles are made for that point, wherever the centre of gravity is.",
        "A step is exact for motions that are linear over it. Choose simulation/dt so that they are: a frame must be",
        "short against the motion, not against the lag.",
    ]
    return _file("aerodynamics", "", notes, lines)


def _system(portable: Portable, name: str) -> str:
    modes, length = portable.modes, portable.model.reference.length / FOOT
    lines = _inputs(portable, "then", "fcs_function")
    step = _product(_v(2.0 / length), "<p>velocities/vt-fps</p>", "<p>simulation/dt</p>")
    lines += _define("fcs_function", "ds", step, "reduced time of a frame, 2V dt/c")
    for i, pole in enumerate(modes.poles):
        lines += _mode(portable, i, complex(pole), i < modes.real)
    notes = [
        "Lag states of unsteady aerodynamics: what the motion up to the frame before this one has left.",
        *portable.notes(),
        "Must run at every frame (no execrate). A change of simulation/dt, or of the speed, is followed.",
    ]
    return _file("system", f' name="{escape(name)}"', notes, ['<channel name="indicial memory">', *lines, "</channel>"])


def _mode(portable: Portable, i: int, pole: complex, real: bool) -> list[str]:
    r"""Lines that take one mode from frame to frame; of a real one the imaginary parts are left out.

    ``alpha + beta = (e^z - 1)/lambda``, ``beta = ((alpha + beta)/ds - 1)/lambda``: exact, and the digits that small z
    costs are of no weight in the load.
    """
    inverse = 1.0 / pole
    over_pole = (_v(inverse.real), _v(inverse.imag))
    v, was, grown, gain, beta, xi = (_named(f"{key}-{i}") for key in ("v", "was", "grown", "gain", "beta", "xi"))
    decay, angle = _exp(_product(_v(pole.real), _p("ds"))), _product(_v(pole.imag), _p("ds"))
    rest = _times((_v(-inverse.real), _v(-inverse.imag)), v, real)
    held = _times(beta, v, real)  # with beta still that of the frame before
    mean = tuple(f"<quotient>{part}{_p('ds')}</quotient>" for part in gain)
    after = _times((_difference(mean[0], _v(1.0)), mean[1]), over_pole, real)
    kept, added = _times(grown, was, real), _times(tuple(map(_difference, gain, beta)), v, real)
    steps = {
        "v": _driven(portable, i, "then"),
        "was": tuple(_if_moving(_sum(*pair), still) for *pair, still in zip(xi, held, rest, strict=True)),
        "grown": (decay, "")
        if real
        else (_product(decay, f"<cos>{angle}</cos>"), _product(decay, f"<sin>{angle}</sin>")),
        "gain": _times((_difference(grown[0], _v(1.0)), grown[1]), over_pole, real),
        "beta": tuple(_if_moving(part, _v(0.0)) for part in after),
        "xi": tuple(_sum(*pair) for pair in zip(kept, added, strict=True)),
    }
    lines = []
    for key, values in steps.items():
        for part, value in zip(("re",) if real else ("re", "im"), values, strict=False):
            lines += _define("fcs_function", f"{key}-{i}-{part}", value)
    return lines


def _inputs(portable: Portable, when: str, kind: str) -> list[str]:
    """Lines that make the model's inputs of JSBSim's motion."""
    lines = _angles(when, kind) if set(ANGLES) & set(portable.model.inputs) else []
    for m, name in enumerate(portable.model.inputs):
        if name in ANGLES:
            made = _difference(_p(f"{when}-{name}"), _v(portable.offsets[m]))
        else:
            over = f"<quotient>{_v(0.5 * portable.lengths[m] / FOOT)}{_SPEED}</quotient>"
            made = _product(_RATES[name], over)
        lines += _define(kind, f"{when}-{m}", made, f"{name} of the model")
    return lines


def _angles(when: str, kind: str) -> list[str]:
    """Lines for the flow angles at AERORP: JSBSim's own are those of the centre of gravity."""
    lines = []
    for axis, ahead in zip("xyz", (-1.0, 1.0, -1.0), strict=True):  # structural axes to body axes, in to ft
        arm = _difference(f"<p>metrics/aero-rp-{axis}-in</p>", f"<p>inertia/cg-{axis}-in</p>")
        lines += _define(kind, f"{when}-arm-{axis}", _product(arm, _v(ahead / 12.0)))
    x, y, z = (_p(f"{when}-arm-{axis}") for axis in "xyz")
    p, q, r = (_RATES[name] for name in "pqr")
    turning = {"u": (q, z, r, y), "v": (r, x, p, z), "w": (p, y, q, x)}
    for name, (a, b, c, d) in turning.items():
        speed = _sum(f"<p>velocities/{name}-aero-fps</p>", _difference(_product(a, b), _product(c, d)))
        lines += _define(kind, f"{when}-{name}", speed)
    u, v, w = (_p(f"{when}-{name}") for name in "uvw")
    across = f"<pow>{_sum(_product(u, u), _product(w, w))}{_v(0.5)}</pow>"
    lines += _define(kind, f"{when}-alpha", f"<atan2>{w}{u}</atan2>", "at the moment reference point")
    return lines + _define(kind, f"{when}-beta", f"<atan2>{v}{across}</atan2>", "at the moment reference point")


def _driven(portable: Portable, i: int, when: str) -> _Complex:
    """``b_i u``."""
    b = portable.modes.b[i]
    real, imaginary = (
        _sum(*(_product(_v(weight), _p(f"{when}-{m}")) for m, weight in enumerate(part))) for part in (b.real, b.imag)
    )
    return real, imaginary


# Expressions of JSBSim


def _v(value: float) -> str:
    return f"<v>{float(value)!r}</v>"


def _p(name: str) -> str:
    return f"<p>indicial/{name}</p>"


def _named(name: str) -> _Complex:
    return _p(f"{name}-re"), _p(f"{name}-im")


def _sum(*terms: str) -> str:
    return terms[0] if len(terms) == 1 else f"<sum>{''.join(terms)}</sum>"


def _product(*factors: str) -> str:
    return f"<product>{''.join(factors)}</product>"


def _difference(a: str, b: str) -> str:
    return f"<difference>{a}{b}</difference>"


def _exp(exponent: str) -> str:
    return f"<exp>{exponent}</exp>"


def _if_moving(then: str, otherwise: str) -> str:
    """`then` where time goes on."""
    return f"<ifthen><gt>{_p('ds')}<v>0</v></gt>{then}{otherwise}</ifthen>"


def _times(a: tuple[str, ...], b: tuple[str, ...], real: bool) -> _Complex:
    """Product of complex expressions; of real ones if both are."""
    if real:
        return _product(a[0], b[0]), _v(0.0)
    return (
        _difference(_product(a[0], b[0]), _product(a[1], b[1])),
        _sum(_product(a[0], b[1]), _product(a[1], b[0])),
    )


def _table(variable: str, curve: Array) -> str:
    rows = " ".join(f"\n{x!r} {y!r}" for x, y in curve.tolist())
    return f'<table><independentVar lookup="row">{variable}</independentVar><tableData>{rows}\n</tableData></table>'


def _define(kind: str, name: str, value: str, description: str = "") -> list[str]:
    """A property ``indicial/NAME``: of a system (``fcs_function``) or of the aerodynamics (``function``)."""
    said = f"<description>{escape(description)}</description>" if description else ""
    inner = f"<function>{said}{value}</function>" if kind == "fcs_function" else f"{said}{value}"
    return [f'<{kind} name="indicial/{name}">{inner}</{kind}>']


def _file(root: str, attributes: str, notes: list[str], lines: list[str]) -> str:
    said = "\n".join(f"  {line}" for line in notes).replace("--", "- -")
    body = "\n".join(f"  {line}" for line in lines)
    return f'<?xml version="1.0"?>\n<!-- Written by indicial.\n{said}\n-->\n<{root}{attributes}>\n{body}\n</{root}>\n'
