"""Drawing of the mazes in which Rocketman hides: ``python -m tools.maze`` writes ``assets/maze``."""
