"""One picture each: measured against model, errors by cell, heat, filters, networks.

`plots` are courses over time; `cells`, `error_maps` and `compare` show where the model is wrong; `network_plot` over
`network_places` draws a motor; the others are named after what they show.
"""
