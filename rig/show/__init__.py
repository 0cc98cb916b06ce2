"""Show what is in a file, or a result in memory, as numbers and tables."""

from typing import TYPE_CHECKING

from vibrolock.on_use import on_use

if TYPE_CHECKING:
    from rig.show.results import as_html as as_html, as_text as as_text
else:
    __getattr__, __dir__, __all__ = on_use(__name__)
