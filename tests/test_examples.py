"""The examples run, and what they assert holds."""

import runpy
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).resolve().parents[1] / "examples").glob("*.py"))


def test_examples_are_numbered_without_gaps():
    assert sorted(int(path.name.partition("_")[0]) for path in EXAMPLES) == list(range(1, len(EXAMPLES) + 1))
    assert len(EXAMPLES) >= 15


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example_runs(path, tmp_path, monkeypatch):
    # the sixth guards its work by __main__, for it takes minutes: here it is only imported
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(path), run_name="example")
