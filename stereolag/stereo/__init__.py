"""Stereo matching: settings, matchers, results and their evaluation."""
