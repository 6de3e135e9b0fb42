"""Everyday drawings by chance, judged by an independent program and by what must not matter.

`kinds` draws readable mechanisms of engineers: doors, shafts, linkages, lifts, carts, arms that strike; `loads` has
what acts on them, by tables and functions of every argument; `chance` puts these together into a `case`: doubled left
and right, rounded or shaken, with stops and contacts passed at speed, drives, any time of start and any option.
`judging` runs a case and says whether it is right, refused or wrong; `checks` are what must not matter; `shrinking`
makes a find as short as it goes.
"""
