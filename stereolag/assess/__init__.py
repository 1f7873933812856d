"""Judgements on a pair and its maps: problems and remedies, reasons for a match, better settings."""
