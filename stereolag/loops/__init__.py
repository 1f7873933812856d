"""The means for compiled loops: compilation, bands of rows over the cores, and vector registers."""
