"""Matching windows by correlation: the settings, the search areas, and the two engines."""
