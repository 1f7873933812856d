"""The infrastructure of compiled loops: compilation, bands of rows over the cores, and vector registers."""
