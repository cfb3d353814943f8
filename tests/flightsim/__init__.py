"""Tests of flight: motion, aerodynamics, modes and damping against exact results."""
