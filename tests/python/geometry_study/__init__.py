"""How the core decides rank, redundancy and misdrawn geometry, judged by truth that it has no part in.

A family is a file with `case(seed)`: a drawing, what it means, its mobility and what it must do. `drawing` says a
mechanism once, for the core and for `program`, which knows free bodies, all closing rows and no tree. `judge` holds one
against the other in both kinds of coordinates.

    python -m geometry_study                 every family with its own number of mechanisms
    python -m geometry_study misdrawn 50 7   fifty of one, from seed 7
"""
