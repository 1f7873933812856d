"""Files packed as a ZIP."""

import io
import zipfile
from collections.abc import Mapping


def zipped(files: Mapping[str, bytes], *, method: int = zipfile.ZIP_STORED) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", method) as whole:
        for name, data in files.items():
            whole.writestr(name, data)
    return stream.getvalue()
