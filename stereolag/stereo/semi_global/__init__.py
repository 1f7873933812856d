"""Matching with a cost volume and semi-global optimisation."""
