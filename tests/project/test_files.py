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
