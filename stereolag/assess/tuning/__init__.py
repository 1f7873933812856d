"""Settings for a pair: judging them, sweeping two at a time, and searching for the best."""
