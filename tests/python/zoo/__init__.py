"""The zoo of the catalogue, compared with theory and with the independent program.

`judging` puts one mechanism side by side with both; `python -m zoo` runs all for their ten seconds, and some at
tolerances from 1e-6 to 1e-11 and in both kinds of coordinates.
"""
