"""What has to be let go at the end, whatever happens: `with`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from types import TracebackType
from typing import Self


class Closing(ABC):
    """Makes a context manager of what is open as soon as it is made, given `close`."""

    @abstractmethod
    def close(self) -> None:
        """Let go. May be called more than once."""

    def __enter__(self) -> Self:
        """Itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close."""
        self.close()
