"""An independent program for mechanisms, and mechanisms drawn by chance to compare it with Partita.

`drawing` describes mechanisms as plain data and builds them through the public face; `chance` draws them; `maximal`
computes accelerations, reactions and their uniqueness in six coordinates for each body, with dense matrices and NumPy
alone; `comparison` puts the two side by side; `shrinking` makes a drawing on which they differ as short as it goes.
"""
