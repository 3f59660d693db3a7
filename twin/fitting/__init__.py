"""Everything that may differ as one vector: what it does to recorded tests, and its fit.

`recorded` is a test as it was measured, `model` a motor with its tests and all that may differ, `fit` the most probable
vector. The vector is 0 where motor file and sensors are right; each of its numbers does one of `actions`. To a test it
may change what drives it (`drive`, made of `rows`), its laws, capacities, boundaries and start (`circuit`), and what
sensors and meters show (`readings`, `metering`).

`twin.run.sparse_march` runs the test. What each number changes is found as heats (`heats`), which the same march
carries through the run as columns; sensors read these as they read the temperatures, and `stamped` takes the means.
`noise` whitens a channel's residual. `one_test` is a model of one test alone, `supposed` what a file says of nodes that
no sensor follows.
"""
