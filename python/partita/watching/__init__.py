"""A page that shows a model file, and shows it anew whenever the file is saved: `partita watch`."""

from .page import WatchPage

__all__ = ["WatchPage"]
