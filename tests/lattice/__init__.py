"""The unsteady vortex lattice against exact theory."""
