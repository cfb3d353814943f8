"""Names for source code."""

import importlib
import sys
from pathlib import Path

import pytest

from indicial.files import sources_digest


def digest(folder: Path, monkeypatch: pytest.MonkeyPatch, text: str) -> str:
    package = folder / "somecode"
    package.mkdir(exist_ok=True)
    (package / "__init__.py").write_text("")
    (package / "kernel.py").write_text(text)
    monkeypatch.syspath_prepend(str(folder))
    sys.modules.pop("somecode", None)
    importlib.invalidate_caches()
    sources_digest.cache_clear()
    return sources_digest("somecode")


def test_changed_code_has_another_name_and_the_same_code_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = digest(tmp_path, monkeypatch, "GAMMA = 1.4\n")
    assert digest(tmp_path, monkeypatch, "GAMMA = 1.4\n") == first
    assert digest(tmp_path, monkeypatch, "GAMMA = 1.3\n") != first


def test_code_that_is_left_out_does_not_change_the_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def names(text: str) -> tuple[str, str]:
        inner = tmp_path / "somecode" / "apart"
        inner.mkdir(parents=True, exist_ok=True)
        (inner / "__init__.py").write_text(text)
        whole = digest(tmp_path, monkeypatch, "GAMMA = 1.4\n")
        return whole, sources_digest("somecode", without="apart")

    (whole, rest), (whole_changed, rest_changed) = names("A = 1\n"), names("A = 2\n")
    assert whole != whole_changed
    assert rest == rest_changed
