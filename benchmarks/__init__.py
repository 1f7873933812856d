"""Every speed and accuracy table against the peers: ``python -m benchmarks``."""
