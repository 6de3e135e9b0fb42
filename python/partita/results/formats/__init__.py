"""Formats of files, one each: `write` makes bytes of a content, `read` finds header and arrays again."""
