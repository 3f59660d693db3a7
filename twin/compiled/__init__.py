"""A network made into code: indices, laws as text and as a program, derivatives, integrator.

`kernel` is the door: straight-line text for a small network (`codegen`, many runs at once `codegen_lanes`, gradients
`codegen_gradient`), a program that takes the network as data for a large one (`indexed`). `differentiate` takes
derivatives from text. Of each law, `law_text` puts the text into the kernel, `heat` compiles a function, and `laws` is
a table of many for loops. `structure` and `sparse` say where a network's numbers stand, `laid_out` is that `once` for
all that ask; `integrators` says how a step is made.
"""
