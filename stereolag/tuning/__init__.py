"""Good settings for a pair: how good they are, all combinations of two, and the search for the best."""
