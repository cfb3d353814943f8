"""The SZD-9 Bocian glider: roll damping from attached flow to autorotation, by moving frame and forced oscillation."""

from indicial.studies.bocian.agreement import claims
from indicial.studies.bocian.computing import compute
from indicial.studies.bocian.figures import draw
from indicial.studies.bocian.pieces import PIECES
from indicial.studies.study import Study

STUDY = Study(
    name="bocian",
    title="SZD-9 Bocian: roll damping from attached flow to autorotation",
    pieces=PIECES,
    compute=compute,
    claims=claims,
    draw=draw,
    subsets={"coarse": ("frame-base-coarse-*",)},
)

__all__ = ["STUDY"]
