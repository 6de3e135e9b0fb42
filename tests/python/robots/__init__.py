"""Robots' files as they stand in a folder: what `partita.load` makes of each, beside other programs."""
