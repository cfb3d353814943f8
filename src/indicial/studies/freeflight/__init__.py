"""One shot of the Basic Finner flown three ways: with derivatives, with a model that remembers, and with the flow."""

from indicial.studies.freeflight.agreement import claims
from indicial.studies.freeflight.computing import compute
from indicial.studies.freeflight.figures import draw
from indicial.studies.freeflight.pieces import COARSE, PIECES
from indicial.studies.study import Study

STUDY = Study(
    name="freeflight",
    title="Basic Finner at M 2, flown by derivatives, by a state-space model and with the flow solver in the loop",
    pieces=PIECES,
    compute=compute,
    claims=claims,
    draw=draw,
    subsets={"coarse": (COARSE.name,)},
)

__all__ = ["STUDY"]
