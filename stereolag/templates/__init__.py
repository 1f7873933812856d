"""Template search in an image: every position scored by correlation, or a few found by exact pixels."""

from stereolag.core.searches import TemplateMethod
from stereolag.templates.search import estimate_search, match_template
from stereolag.templates.verdict import TemplateMatch, TemplateSearch

__all__ = ["TemplateMatch", "TemplateMethod", "TemplateSearch", "estimate_search", "match_template"]
