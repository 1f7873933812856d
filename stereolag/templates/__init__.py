"""Template search in an image: every position scored by correlation, or a few found by exact pixels."""

from stereolag.core.searches import TemplateMethod
from stereolag.templates.estimates import estimate_search
from stereolag.templates.result import TemplateMatch, TemplateSearch
from stereolag.templates.search import match_template

__all__ = ["TemplateMatch", "TemplateMethod", "TemplateSearch", "estimate_search", "match_template"]
