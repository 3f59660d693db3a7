"""What a session holds, how good it is, whether its power balances, where it was driven.

`channels` loads a session's channels, corrected as the bench file says. `quality`, `power`, `operating_points` and
`kinds` judge them. `looked` is all that over a `decoded` log, `description` the same as data; `show` and `page` put it
on a page.
"""
