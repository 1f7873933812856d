"""A page whose connection was lost runs again as a whole when it is back.

The browser then shows a page of which the server may know nothing any more, and parts of a page that it does not know
it leaves unanswered, without a word.
"""

from __future__ import annotations

import streamlit as st

KEY = "reconnection"

_watch = st.components.v2.component(
    "stereolag.reconnection",
    js="""
export default function ({ setTriggerValue }) {
  const app = document.querySelector("[data-testid=stApp]");
  const connected = () => app.dataset.testConnectionState === "CONNECTED";
  let before = connected();
  const observer = new MutationObserver(() => {
    const now = connected();
    if (now && !before) setTriggerValue("back", true);
    before = now;
  });
  observer.observe(app, { attributes: true, attributeFilter: ["data-test-connection-state"] });
  return () => observer.disconnect();
}
""",
)


def run_again_when_reconnected() -> None:
    """Watch the connection of this page; must be called outside of its parts that rerun alone."""
    _watch(key=KEY, on_back_change=lambda: None)
