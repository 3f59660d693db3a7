"""What a session holds, how good it is, whether its power balances, where it was driven.

`channels` loads a session's channels, corrected as the bench file says. `quality`, `power`, `operating_points` and
`kinds` judge them; `show` and `page` put that on a page.
"""
