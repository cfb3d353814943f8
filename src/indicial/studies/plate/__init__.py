"""Realisations side by side: of the exact supersonic plate, which settles in finite time, and of the Finner at M 2."""

from indicial.studies.plate.agreement import claims
from indicial.studies.plate.computing import compute
from indicial.studies.plate.figures import draw
from indicial.studies.plate.pieces import PIECES
from indicial.studies.study import Study

STUDY = Study(
    name="plate",
    title="Reduced-order models: the exact supersonic plate, and the Finner at M 2",
    pieces=PIECES,
    compute=compute,
    claims=claims,
    draw=draw,
    subsets={"coarse": ("realise-plate-exact-M2.000",)},
)

__all__ = ["STUDY"]
