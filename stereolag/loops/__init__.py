"""The compiled loops, each beside the plain NumPy formula it must equal."""
