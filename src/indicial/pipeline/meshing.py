"""The mesh stage: half and whole model, checked."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from indicial.cfd.mesh import WideDomain, finned_body_mesh
from indicial.pipeline.context import Context, Outcome


def make_meshes(context: Context) -> Outcome:
    """Make, check and keep the meshes."""
    case, results = context.case, dict[str, Any]()
    given = case.mesh
    domain = WideDomain(given.upstream_calibres, given.downstream_calibres, given.radius_calibres)
    for done, (name, sector) in enumerate((("half", "half"), ("whole", "full"))):
        context.reporter.update(done / 2.0, f"{name} model")
        mesh = finned_body_mesh(
            case.body,
            given.resolution,
            mach=case.condition.mach,
            sector=sector,  # type: ignore[arg-type]
            margin=given.margin,
            wake=given.wake,
            domain=domain,
        )
        report = mesh.check()
        mesh.save(context.folder.mesh(whole=name == "whole"))
        results[name] = asdict(report)
    cells = " and ".join(f"{results[name]['n_cells']:,} cells ({name})" for name in results)
    return Outcome(results, cells)
