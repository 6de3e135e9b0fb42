"""An independent program for mechanisms, and mechanisms drawn by chance to compare it with Partita.

`drawing` describes mechanisms as plain data and builds them through the public face; `chance` draws them, `elements`
with every joint, force, table and curve; `maximal` computes accelerations, reactions and their uniqueness in six
coordinates for each body, with dense matrices and NumPy alone, what acts on the bodies by `forces`, `couplings` and
`curves`; `comparison` puts the two side by side; `shrinking` makes a drawing on which they differ as short as it goes.
`coupled`, `sensors`, `files` and `fmus` compare couplings, sensors, model files and FMUs.
"""
