"""Many pairs of pictures, read on demand."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, overload

from stereolag.core.inputs import Image
from stereolag.io.images import read_image
from stereolag.io.pairing import PairFiles
from stereolag.io.sources import quoted


class PicturesOfFiles(Sequence[tuple[Image, Image]]):
    """Pairs of pictures that are decoded again on every access: all at once would take gigabytes."""

    def __init__(self, files: Sequence[PairFiles], read: Callable[[str], bytes]) -> None:
        self._files = files
        self._read = read

    def __len__(self) -> int:
        return len(self._files)

    @overload
    def __getitem__(self, number: int) -> tuple[Image, Image]: ...
    @overload
    def __getitem__(self, number: slice) -> Sequence[tuple[Image, Image]]: ...
    def __getitem__(self, number: Any) -> Any:
        if isinstance(number, slice):
            return PicturesOfFiles(self._files[number], self._read)
        files = self._files[number]
        return self._picture(files.left), self._picture(files.right)

    def _picture(self, name: str) -> Image:
        try:
            return read_image(self._read(name))
        except ValueError as error:
            raise ValueError(f"{quoted(name)}: {error}") from error
