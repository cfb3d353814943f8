"""Parametric shapes: airfoil, cone, finned body, lifting surfaces."""

from indicial.cfd.shapes.airfoil import Airfoil
from indicial.cfd.shapes.cone import Cone
from indicial.cfd.shapes.finned_body import FinnedBody
from indicial.cfd.shapes.fins import FinSet, Section
from indicial.cfd.shapes.lifting_surface import LiftingSurface, SpanStation
from indicial.cfd.shapes.nose import Nose, NoseType
from indicial.cfd.shapes.wing_section import WingSection

__all__ = [
    "Airfoil",
    "Cone",
    "FinSet",
    "FinnedBody",
    "LiftingSurface",
    "Nose",
    "NoseType",
    "Section",
    "SpanStation",
    "WingSection",
]
