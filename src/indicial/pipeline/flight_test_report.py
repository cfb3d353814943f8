"""The files of a reduced flight test: numbers, text, figures, and one page with all of them."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import indicial
from indicial.files import write_text
from indicial.pipeline.flight_test import FlightTestResult, ReducedRecord
from indicial.pipeline.progress import LogReporter, Reporter
from indicial.report.html import Chapter, Grid, Picture, write_html
from indicial.report.identified import INTERVAL, estimates_figure
from indicial.report.style import figure_style, save

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def write_flight_test(result: FlightTestResult, folder: str | Path, reporter: Reporter | None = None) -> Path:
    """Write ``flight_test.json``, ``summary.txt``, ``figures/`` and ``report.html`` into a folder; the page's path."""
    into, told, begun = Path(folder), LogReporter() if reporter is None else reporter, time.monotonic()
    told.start("Figures and report")
    write_text(into / "flight_test.json", json.dumps(result.to_dict(), indent=1, allow_nan=False))
    write_text(into / "summary.txt", result.summary() + "\n")
    expected, pictures = 1 + 3 * len(result.records), dict[str, Path]()
    for name, figure in _figures(result):
        told.update(len(pictures) / expected, name)
        pictures[name] = save(figure, into / "figures" / f"{name}.png")
    chapters = [_derivatives(result, pictures)]
    chapters += [_record(one, pictures) for one in result.records]
    page = into / "report.html"
    write_html(page, result.test.title, _lead(result), chapters, {"indicial": indicial.__version__})
    told.finish(time.monotonic() - begun, str(page))
    return page


def _figures(result: FlightTestResult) -> Iterator[tuple[str, Figure]]:
    fit = result.fit
    names = [one.name for one in fit.parameters]
    by_other = {name: found for name in names if (found := result.by_equation_error(name)) is not None}
    sources = {
        "output error": {one.name: (one.value, one.standard_error) for one in fit.parameters},
        "equation error": {name: (one.value, one.standard_error) for name, one in by_other.items()},
    }
    if result.verdicts:
        sources["expected"] = {v.estimate.name: (v.before, v.before_error) for v in result.verdicts}
    yield "derivatives", estimates_figure(names, sources)
    with figure_style():
        for number, one in enumerate(result.records):
            yield f"record_{one.name}", one.diagnosis.plot()
            if one.compatibility is not None:
                yield f"compatibility_{one.name}", one.compatibility.plot()
            yield f"fit_{one.name}", fit.plot(number)


def _lead(result: FlightTestResult) -> list[str]:
    """What came out."""
    number = sum(len(one.record) for one in result.records)
    records = "one record" if len(result.records) == 1 else f"{len(result.records)} records"
    lead = [f"{len(result.fit.parameters)} values identified by output error from {records} of {number} samples."]
    for word in ("shifted", "unidentifiable", "consistent"):
        told = [
            f"{v.estimate.name} {v.estimate.value:.4g} ±{v.estimate.standard_error:.2g} "
            f"(expected {v.before:.4g} ±{v.before_error:.2g})"
            for v in result.verdicts
            if v.verdict == word
        ]
        if told:
            lead.append(f"{word.capitalize()}: {', '.join(told)}.")
    return lead


def _derivatives(result: FlightTestResult, pictures: dict[str, Path]) -> Chapter:
    words = {verdict.estimate.name: verdict for verdict in result.verdicts}
    rows = []
    for one in result.fit.parameters:
        other, told = result.by_equation_error(one.name), words.get(one.name)
        rows.append(
            [
                one.name,
                f"{one.value:.5g} ±{one.standard_error:.2g}",
                "" if other is None else f"{other.value:.5g} ±{other.standard_error:.2g}",
                "" if told is None else f"{told.before:.5g} ±{told.before_error:.2g}",
                "" if told is None else told.verdict,
            ]
        )
    text = ["Per radian, rates as q c/2V, p b/2V and r b/2V; body axes. Plus or minus one standard error."]
    if result.test.fixed:
        text.append(
            "Taken as known: " + ", ".join(f"{name} {value:g}" for name, value in result.test.fixed.items()) + "."
        )
    if result.test.prior:
        text.append(f"Bound to what was expected, and so without a verdict: {', '.join(result.test.prior)}.")
    text += [f"{text[0].upper()}{text[1:]}." for text in (*result.fit.findings, *result.fit.suspicious())]
    if result.left_out:
        text.append(f"{result.left_out} samples were left out as outliers.")
    noise = [
        [channel, f"{factor:.3g}", "white" if result.fit.memory[channel].size == 0 else "coloured"]
        for channel, factor in result.fit.noise.items()
    ]
    return Chapter(
        "Derivatives",
        text,
        [
            Grid(("", "output error", "equation error", "expected", "verdict"), rows),
            Grid(
                ("channel", "noise / stated", "residuals"),
                noise,
                "Noise found, against what the map states or, where it states none, the roughness of the samples",
            ),
        ],
        [Picture(pictures["derivatives"], f"Estimates and {INTERVAL} standard errors.")],
    )


def _record(one: ReducedRecord, pictures: dict[str, Path]) -> Chapter:
    """What one record was like, what was wrong with it, and how it is fitted."""
    text = [finding.summary() for finding in one.diagnosis.findings] or [
        "Its channels by themselves: nothing is wrong."
    ]
    shown = [Picture(pictures[f"record_{one.name}"], "The record as it was read.")]
    if one.compatibility is not None:
        found = "; ".join(one.compatibility.findings)
        text.append(f"Its instruments beside each other: {found or 'they agree'}.")
        name = f"compatibility_{one.name}"
        shown.append(Picture(pictures[name], "Instruments, and what accelerometers and gyros imply of them."))
    text += [f"{note[0].upper()}{note[1:]}." for note in one.notes]
    shown.append(Picture(pictures[f"fit_{one.name}"], "Measured and fitted, and residuals in standard deviations."))
    return Chapter(f"Record {one.name}", text, (), shown)
