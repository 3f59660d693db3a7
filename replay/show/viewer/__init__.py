"""Sessions in the rerun viewer: layers, layout, and the program that shows them.

`seen` is what is shown of a session, `blueprint` where, `layers` writes it to a `layer_file`, with what stands `beside`
its lines; `network_layer` and `cut` are the motor coloured by its temperatures; `aligned` lays sessions over one
another; `program` opens the viewer.
"""
