"""A motor as data: nodes, links, laws, sensors, what is refused, and motors made from motors. Nothing runs here.

`network` is the data; `features` are what its laws are made of, `check` refuses what cannot be a motor, `causes`
spells the ids of causes, `observables` and `outputs` say what meters and sensors read. `configured` is the motor on
another rig, `ageing_law` the motor of an old specimen; `scaling`, `slicing` and `merging` make motors from motors.
"""
