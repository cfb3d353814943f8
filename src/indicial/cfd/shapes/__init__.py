"""Parametric shapes: airfoil, cone, finned body."""

from indicial.cfd.shapes.airfoil import Airfoil
from indicial.cfd.shapes.cone import Cone
from indicial.cfd.shapes.finned_body import FinnedBody
from indicial.cfd.shapes.fins import FinSet, Section
from indicial.cfd.shapes.nose import Nose, NoseType

__all__ = ["Airfoil", "Cone", "FinSet", "FinnedBody", "Nose", "NoseType", "Section"]
