"""Stages shared by the project's own matchers once disparities are found: checks, filters, filling, median."""
