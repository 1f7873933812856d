"""Window matching by correlation: the settings, the search areas, and the two engines."""
