r"""What a strip's separation sees of its neighbours: the mean of their incidences over about a chord of span.

Section data hold where the flow changes little across the span in the length of a chord. Each strip on its own obeys
its polar however narrow it is, and beyond the lift maximum that has no length: a wave across an endless wing of lift
slope ``a < 0`` sheds a wake whose wash, ``w = k Gamma/4``, makes it grow if it is shorter than ``-pi a c/4``, and the
shorter, the quicker (lifting-line theory; Spalart, AIAA J. 52, 2014, and Gross, Fasel and Gaster, AIAA J. 53, 2015,
take that for the origin of stall cells). On a lattice the shortest wave is two strips. So the incidence that a
separation point answers to may be averaged across the span with a Gaussian weight, as filtered lifting-line theory does
with what a section meets (Martinez-Tossas and Meneveau, J. Fluid Mech. 863, 2019):

    alpha_seen(s) = integral of alpha(s') exp(-((s - s')/(spread c(s)))^2) ds', divided by that of the weight.

A wave of length lambda is then seen ``exp(-(pi spread c/lambda)^2)`` times as high, and cells have a width of the wing,
not of its strips; flow that is attached is left as it is. That a section's data hold over a chord is an estimate of
size: no source gives the spread for stall.
"""

from __future__ import annotations

import numpy as np

from indicial.cfd.lattice.sheets import Strips
from indicial.conventions import Array


def spanwise_mean(strips: Strips, spread: float) -> Array | None:
    """Weights of all strips in the mean of each, shape (S, S); None for no spread.

    Parameters
    ----------
    strips : Strips
    spread : float
        Width of the Gaussian in chords of the strip that sees.
    """
    if spread == 0.0:
        return None
    place = strips.quarter_chord[:, 1:]
    distance = np.linalg.norm(place[:, None] - place, axis=-1)
    weight = strips.width * np.exp(-((distance / (spread * strips.chord[:, None])) ** 2))
    names = np.array(strips.surface)
    weight[names[:, None] != names] = 0.0
    return np.asarray(weight / np.sum(weight, axis=1, keepdims=True))
