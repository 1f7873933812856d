"""The basis of the package: types, checks on arrays, settings, limits and the cost of a job."""
