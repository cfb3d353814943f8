"""The whole line on a packaged case, as `indicial run` does it, and how to read what it leaves.

Takes minutes: run it by itself (``python examples/6_whole_line.py [CASE]``).
"""

import sys

from indicial.derivatives import DerivativeTable
from indicial.pipeline import open_run, run_stages


def main(case_file: str = "basic_finner_quick") -> None:
    case, folder = open_run(case_file)
    run_stages(case, folder)
    table = DerivativeTable.from_json(folder.path / "results.json")
    print(table.select(name="Cm_q+Cm_alphadot").summary())


# Worker processes import this file: what starts them must not run in them.
if __name__ == "__main__":
    main(*sys.argv[1:])
