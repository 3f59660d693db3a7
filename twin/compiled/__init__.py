"""A network made into code: indices, laws as text and as a program, derivatives, integrator.

`kernel` is the door: straight-line text for a small network (`codegen`), a program that takes the network as data for
a large one (`indexed`), with the same arithmetic. `structure` and `sparse` say where its numbers stand, `integrators`
how a step is made, `differentiate` takes derivatives from the text itself.
"""
