"""The headline of a result, read aloud by screen readers when it changes."""

from __future__ import annotations

from stereolag.core.typography import typeset
from stereolag.ui.components import component

KEY = "announced"

_region = component("announcement")


def announce(headline: str) -> None:
    """Announce a headline, plain or Markdown, through a polite live region once it has been stable for a moment.

    Call it once per page: this is the only live region for results. Streamlit announces refusals and failures itself.
    """
    _region(key=KEY, data=typeset(headline.replace("**", "")))
