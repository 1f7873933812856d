"""Build hook of the wheel: an install from the checkout itself (`pip install --editable .`) needs no copies."""

from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class Inside(BuildHookInterface):
    """Puts the app and the examples inside the package."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Add the files that the table `inside` of pyproject.toml lists."""
        if version == "standard":
            build_data["force_include"].update(self.config["inside"])
