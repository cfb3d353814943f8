"""The figures asked of the study."""

from __future__ import annotations

from indicial.studies.claim import Claim
from indicial.studies.kept import Results


def claims(results: Results) -> tuple[Claim, ...]:
    """None yet."""
    return ()
