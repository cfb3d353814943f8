"""Run a benchmark: ``python benchmarks/run.py`` lists them, ``python benchmarks/run.py NAME`` runs one.

A benchmark is a file beside this one with a docstring and a function ``measure() -> list[Figure]``; an underscore
stands behind a name that another module has. Each figure that has a target is a ratio against a peer or a limit
that is measured in the same run, so it holds on any machine. The last line printed is JSON:
``{"benchmark", "figures": [{"name", "value", "unit", "target", "holds"}]}``.
"""

from __future__ import annotations

import argparse
import importlib
import json
import sys
from dataclasses import asdict
from pathlib import Path

HERE = Path(__file__).parent
NOT_BENCHMARKS = {"run", "figures"}


def modules() -> dict[str, str]:
    """Names of the benchmarks, and of their modules."""
    stems = sorted(path.stem for path in HERE.glob("*.py") if path.stem not in NOT_BENCHMARKS)
    return {stem.rstrip("_"): stem for stem in stems}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("name", nargs="?", help="which one; without it, list them")
    chosen = parser.parse_args().name
    sys.path.insert(0, str(HERE))
    if chosen is None:
        for name, module in modules().items():
            summary = (importlib.import_module(module).__doc__ or "").splitlines()[0]
            print(f"{name:<12}{summary}")
        return 0
    if chosen not in modules():
        print(f"no benchmark {chosen!r}; there are {', '.join(modules())}", file=sys.stderr)
        return 2
    figures = importlib.import_module(modules()[chosen]).measure()
    for figure in figures:
        print(figure.line())
    print(json.dumps({"benchmark": chosen, "figures": [asdict(figure) for figure in figures]}))
    return 0 if all(figure.holds is not False for figure in figures) else 1


if __name__ == "__main__":
    sys.exit(main())
