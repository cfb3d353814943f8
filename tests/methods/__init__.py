"""Tests of the derivative methods against exact solvers."""
