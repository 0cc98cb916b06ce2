"""Objects that are closed when their ``with`` statement ends."""

from abc import ABC, abstractmethod
from typing import Self


class Closing(ABC):
    """Base of context managers whose end is `close`."""

    @abstractmethod
    def close(self) -> None:
        """Release what is held; may be called twice."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
