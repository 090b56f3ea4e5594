"""Distances for n2n, by somebody else."""
