"""What all cameras here share: `with`."""

from __future__ import annotations

from types import TracebackType
from typing import Self


class Closing:
    """Makes a camera a context manager, given `open` and `close`."""

    def open(self) -> None:
        """See `devices.camera.Camera`."""
        raise NotImplementedError

    def close(self) -> None:
        """See `devices.camera.Camera`."""
        raise NotImplementedError

    def __enter__(self) -> Self:
        """Open."""
        self.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close."""
        self.close()
