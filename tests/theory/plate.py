"""The exact flat plate, which the study of realisations stands on, under the tests' own name."""

from indicial.studies.plate.exact import (
    SupersonicPlate,
    about_axis,
    frequency_response,
    incidence_derivatives,
    settling_tau,
    steady_response,
    subsonic_early_step,
    supersonic_step,
)

__all__ = [
    "SupersonicPlate",
    "about_axis",
    "frequency_response",
    "incidence_derivatives",
    "settling_tau",
    "steady_response",
    "subsonic_early_step",
    "supersonic_step",
]
