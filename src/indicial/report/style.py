"""One look for all figures: colours by method, words for symbols, sizes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from indicial.files import atomic_path

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Okabe and Ito's colours, told apart with any colour vision.
BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILION, PURPLE, GREY = "#0072B2", "#D55E00", "#CC79A7", "#7F7F7F"

METHOD_COLOURS = {
    "mrf": BLUE,
    "irm": GREEN,
    "operator": SKY,
    "rom": PURPLE,
    "fom": ORANGE,
    "operator_at_k": SKY,
    "identified": VERMILION,
    "measured": BLACK,
}
METHOD_MARKERS = {
    "mrf": "o",
    "irm": "^",
    "operator": "P",
    "rom": "v",
    "fom": "s",
    "operator_at_k": "X",
    "identified": "D",
    "measured": "*",
}
METHOD_NAMES = {
    "mrf": "moving frame (MRF)",
    "irm": "indicial response (IRM)",
    "operator": "linearised flow (operator)",
    "rom": "reduced-order model",
    "fom": "forced oscillation (FOM)",
    "operator_at_k": "operator at the k of FOM",
    "identified": "identified from the flight",
    "measured": "measured in free flight",
}
METHOD_SHORT = {
    "mrf": "MRF",
    "irm": "IRM",
    "operator": "operator",
    "rom": "model",
    "fom": "FOM",
    "operator_at_k": "operator at k",
    "identified": "identified",
    "measured": "free flight",
}

_SYMBOLS = {
    "CN": "C_N",
    "Cm": "C_m",
    "CA": "C_A",
    "Cl": "C_l",
    "CX": "C_X",
    "CY": "C_Y",
    "CZ": "C_Z",
    "Cn": "C_n",
}
_SUBSCRIPTS = {"alpha": r"\alpha", "alphadot": r"\dot{\alpha}", "beta": r"\beta"}


def symbol(name: str) -> str:
    r"""A derivative's name as mathematics: ``Cm_q+Cm_alphadot`` becomes :math:`C_{mq}+C_{m\dot\alpha}`."""
    return f"${'+'.join(_one_symbol(part) for part in name.split('+'))}$"


def _one_symbol(name: str) -> str:
    coefficient, _, motion = name.partition("_")
    letter = _SYMBOLS.get(coefficient, coefficient)
    if not motion:
        return letter
    base, _, sub = letter.partition("_")
    factors = r"\,".join(_factor(factor) for factor in motion.split("*"))
    return f"{base}_{{{sub}{factors}}}"


def _factor(factor: str) -> str:
    """A factor of a term, such as ``alpha^2`` or ``elevator``, as a subscript."""
    base, _, power = factor.partition("^")
    letters = _SUBSCRIPTS.get(base, base if len(base) == 1 else rf"\,\mathrm{{{base}}}")
    return f"{letters}^{power}" if power else letters


@contextmanager
def figure_style() -> Iterator[Any]:
    """Matplotlib, with this report's settings and no display."""
    import matplotlib as mpl

    settings: dict[Any, Any] = {
        "font.size": 10,
        "axes.grid": True,
        "grid.alpha": 0.3,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "legend.frameon": False,
        "figure.dpi": 110,
        "figure.constrained_layout.use": True,
    }
    with mpl.rc_context(settings):
        import matplotlib.pyplot as plt

        plt.switch_backend("Agg")
        yield plt


def save(figure: Figure, path: Path) -> Path:
    """Write a figure as PNG in one step, and release it."""
    import matplotlib.pyplot as plt

    with atomic_path(path) as temporary:
        figure.savefig(temporary, format="png", dpi=130, bbox_inches="tight")
    plt.close(figure)
    return path
