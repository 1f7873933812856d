"""Matching by a volume of costs and semi-global optimisation."""
