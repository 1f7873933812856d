"""The parts of the page that searches for a template."""
