"""From histories to a checked model, in one call: derivatives, error bars, predictions of motions not seen."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from indicial.derivatives import DerivativeTable
from indicial.errors import InputError, NoLimitError
from indicial.files import atomic_path, write_text
from indicial.history import History
from indicial.rom.check import PredictionCheck, check_prediction
from indicial.rom.comparison import Comparison, compare
from indicial.rom.convolution import ConvolutionModel
from indicial.rom.deficiency import DeficiencyIntegral, deficiency_integral
from indicial.rom.era import settling_time
from indicial.rom.identification import identify
from indicial.rom.quasi_steady import QuasiSteadyError, QuasiSteadyModel, quasi_steady_error
from indicial.rom.realisation import realise
from indicial.rom.record_length import record_length
from indicial.rom.response import StepResponses
from indicial.rom.signals import ANGLES, STEP_KINDS
from indicial.rom.state_space import StateSpaceModel

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_BAND = (0.05, 10.0)  # reduced frequencies of the quasi-steady comparison, times the settling time
_RESOLUTION = 300


@dataclass(frozen=True)
class BuiltModel:
    """A model of histories, and all that is known of it.

    Parameters
    ----------
    model : StateSpaceModel
    derivatives : DerivativeTable
        At k -> 0, those by Eq. (17) with their error bars.
    responses : StepResponses or None
        What the model was realised from; none if it was identified from general motions.
    integrals : dict
        `DeficiencyIntegral` of each alphadot derivative that has a limit, by its name.
    checks : tuple of PredictionCheck
        Of motions that the model was not made from.
    quasi_steady : QuasiSteadyError or None
        How far in frequency derivatives alone would do, where alpha and q are both known.
    comparison : Comparison or None
        All realisations side by side, if asked for.
    """

    model: StateSpaceModel
    derivatives: DerivativeTable
    responses: StepResponses | None = None
    integrals: dict[str, DeficiencyIntegral] | None = None
    checks: tuple[PredictionCheck, ...] = ()
    quasi_steady: QuasiSteadyError | None = None
    comparison: Comparison | None = None

    def summary(self) -> str:
        """Everything in words."""
        parts = [] if self.responses is None else [self.responses.summary()]
        parts += [self.model.summary(), "derivatives at k -> 0\n" + self.derivatives.summary()]
        if self.integrals:
            parts.append("deficiency integrals, Eq. (17)")
            parts[-1] += "".join(f"\n  {name}: {one.summary()}" for name, one in self.integrals.items())
        if self.quasi_steady is not None:
            parts.append("derivatives alone, Eq. (16)\n  " + self.quasi_steady.summary().replace("\n", "\n  "))
        parts += [check.summary() for check in self.checks]
        if self.comparison is not None:
            parts.append(self.comparison.summary())
        if not self.checks:
            parts.append("no prediction check: no motion is given that the model was not made from")
        return "\n\n".join(parts)

    def figures(self) -> dict[str, Figure]:
        """Figures by name: step responses, cost of shorter records, quasi-steady limits, predictions, comparison."""
        found = {"model": self.model.plot(self.responses)}
        if self.integrals:
            found["record_length"] = self._draw_record_length()
        if self.quasi_steady is not None:
            found["quasi_steady"] = self.quasi_steady.plot()
        for i, check in enumerate(self.checks):
            found[f"check_{i + 1}_{check.measured.motion.get('kind', 'motion')}"] = check.plot()
        if self.comparison is not None:
            found["comparison"] = self.comparison.plot()
        return found

    def _draw_record_length(self) -> Figure:
        """What shorter records would have given for the derivatives of Eq. (17)."""
        import matplotlib.pyplot as plt

        assert self.responses is not None
        assert self.integrals is not None
        figure, axes = plt.subplots(1, len(self.integrals), squeeze=False, layout="constrained")
        figure.set_size_inches(5.0 * len(self.integrals), 3.6)
        for ax, name in zip(axes[0], self.integrals, strict=True):
            output, _, input_ = name.removesuffix("dot").partition("_")
            s, values = self.responses.channel(output, input_)
            final = self.responses[input_].final
            known = None if final is None else float(final[self.responses.outputs.index(output)])
            record_length(s, values, known, name=name).plot(ax)
        return figure

    def write(self, folder: str | Path) -> tuple[Path, ...]:
        """Model (JSON, netCDF), step responses, derivatives, summary and figures (PNG), into a folder."""
        import matplotlib.pyplot as plt

        into = Path(folder)
        files = [into / name for name in ("summary.txt", "model.json", "model.nc", "derivatives.json")]
        write_text(files[0], self.summary() + "\n")
        self.model.to_json(files[1])
        self.model.to_netcdf(files[2])
        self.derivatives.to_json(files[3])
        if self.responses is not None:
            files.append(into / "step_responses.nc")
            self.responses.to_netcdf(files[-1])
        for name, figure in self.figures().items():
            files.append(into / f"{name}.png")
            with atomic_path(files[-1]) as temporary:
                figure.savefig(temporary, dpi=120)
            plt.close(figure)
        return tuple(files)


def build_model(
    histories: Sequence[History],
    outputs: tuple[str, ...] = ("CN", "Cm"),
    *,
    unseen: Sequence[History] = (),
    max_order: int = 6,
    side_by_side: bool = False,
) -> BuiltModel:
    """A model of histories, with its derivatives and checks.

    If there are steps, the model is realised from them and predicts all other histories, which it has not seen. If
    there are none, it is identified from the motions that there are.

    Parameters
    ----------
    histories : sequence of History
        At one flight condition.
    outputs : tuple of str
    unseen : sequence of History
        More motions, of which the model shall not be made.
    max_order : int
        Most poles for each input.
    side_by_side : bool
        Make every other realisation of the steps too, judged by the motions not seen.

    Raises
    ------
    InputError
        If the histories do not do for a model; the message says why.
    """
    steps = [one for one in histories if one.motion.get("kind") in STEP_KINDS]
    others = [one for one in histories if one.motion.get("kind") not in STEP_KINDS]
    if not steps:
        model = identify(others, outputs=outputs)
        return BuiltModel(model, model.derivatives(), checks=_checks(model, unseen))
    if side_by_side and not (others or unseen):
        raise InputError("realisations are judged by motions they have not seen: give a history that is no step")
    responses = StepResponses.from_histories(steps, outputs)
    model = realise(responses, max_order=max_order)
    checks = _checks(model, [*others, *unseen])
    integrals = _integrals(responses)
    return BuiltModel(
        model=model,
        derivatives=_with_error_bars(model, integrals),
        responses=responses,
        integrals=integrals,
        checks=checks,
        quasi_steady=_quasi_steady(responses, model),
        comparison=compare(responses, [*others, *unseen], max_order=max_order) if side_by_side else None,
    )


def _checks(model: StateSpaceModel, histories: Sequence[History]) -> tuple[PredictionCheck, ...]:
    """Predictions of the histories that move what the model knows, of oscillations their last period."""
    checks = []
    for history in histories:
        since = 0.0
        if "omega" in history.motion:
            period = 2.0 * math.pi / float(history.motion["omega"])
            since = max(0.0, float(history.s[-1]) * (1.0 - period / float(history.time[-1])) * (1.0 - 1e-9))
        checks.append(check_prediction(model, history, since=since))
    return tuple(checks)


def _integrals(responses: StepResponses) -> dict[str, DeficiencyIntegral]:
    found = {}
    for response in responses.responses:
        for i, output in enumerate(responses.outputs):
            if response.input not in ANGLES:
                continue
            name = f"{output}_{response.input}dot"
            final = None if response.final is None else float(response.final[i])
            try:
                found[name] = deficiency_integral(response.s, response.values[:, i], final, name=name)
            except (NoLimitError, InputError):
                continue  # the model keeps the reason among what it refuses
    return found


def _with_error_bars(model: StateSpaceModel, integrals: dict[str, DeficiencyIntegral]) -> DerivativeTable:
    """The model's derivatives, with the error bars of the integrals."""
    factor = 1.0 if model.reference.rate_normalisation == "c/2V" else 0.5
    lengths = dict(zip(ANGLES, model.reference.moment_lengths[[1, 2]] / model.reference.length, strict=True))
    known = {
        name: one.uncertainty * factor / lengths[name.rpartition("_")[2].removesuffix("dot")]
        for name, one in integrals.items()
    }
    return DerivativeTable(
        tuple(replace(one, uncertainty=known.get(one.name, one.uncertainty)) for one in model.derivatives())
    )


def _quasi_steady(responses: StepResponses, model: StateSpaceModel) -> QuasiSteadyError | None:
    """Derivatives against the whole memory over k; none unless both inputs of a pitch oscillation are known."""
    if not {"alpha", "q"} <= set(responses.inputs) or model.refused:
        return None
    settled = max(settling_time(one.s, one.deficiency) for one in responses.responses)
    k = np.geomspace(*_BAND, _RESOLUTION) / settled
    return quasi_steady_error(QuasiSteadyModel.from_responses(responses), ConvolutionModel(responses), k)
