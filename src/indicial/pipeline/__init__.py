"""The main job: a case file through all stages, resumable."""
