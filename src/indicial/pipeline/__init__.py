"""The main job: a case file through all stages, resumable."""

from indicial.pipeline.folder import RunFolder, open_run
from indicial.pipeline.progress import LogReporter, Reporter
from indicial.pipeline.stages import ALL_STAGES, STAGES, Stage, run_stages

__all__ = ["ALL_STAGES", "STAGES", "LogReporter", "Reporter", "RunFolder", "Stage", "open_run", "run_stages"]
