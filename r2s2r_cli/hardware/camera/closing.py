"""What all cameras here share: `with`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from types import TracebackType
from typing import Self


class Closing(ABC):
    """Makes a camera a context manager, given `open` and `close`."""

    @abstractmethod
    def open(self) -> None:
        """See `devices.camera.Camera`."""

    @abstractmethod
    def close(self) -> None:
        """See `devices.camera.Camera`."""

    def __enter__(self) -> Self:
        """Open."""
        self.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close."""
        self.close()
