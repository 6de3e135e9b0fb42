"""The logger "partita" of the standard library: warnings for what looks like a mistake, information on what is done.

Warnings appear on standard error unless logging is configured otherwise.
`logging.getLogger("partita").setLevel("ERROR")` silences them; `logging.basicConfig(level="INFO")` shows runs with
their cost as well.
"""

from __future__ import annotations

import logging

logger = logging.getLogger("partita")
