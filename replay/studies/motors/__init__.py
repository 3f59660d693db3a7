"""Motor files made from nothing, from motors of another size, and from motors of more nodes.

`new` fills a template, `scale` changes size or cuts along the stack, `reduce` leaves fewer nodes; `motorcad` and
`motorcad_maps` take what a design program exports, `loss_tables` any table of operating points, as `loss_maps`.
"""
