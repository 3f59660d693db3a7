"""Numbers, places and findings in plain words, colours, one empty figure or page.

`words` says numbers and places, `findings`, `heat_words` and `filter_words` what runs found, `courses` what insulation
does, `terminal` a whole replay. `palette` has the colours, `figure` and `page` an empty figure and page, `layout` the
places of nodes in a picture, `thin` shortens long series without losing an extreme; `width` is that of printed text,
`onward` the commands that it ends with.
"""
