"""The stages that all of our matchers share once a disparity is found: checks, filters, filling, median."""
