"""A motor as data: nodes, links, laws, sensors, what is refused, and motors made from motors. Nothing runs here.

`network` is the data, `paths` its links by name; `features` are what its laws are made of, `heat_laws` the laws
themselves, each one row of text. `check` refuses what cannot be a motor, `causes` spells the ids of causes. `sensor`
describes a thermometer, `sensor_laws` what each kind of error makes it read; `outputs` and `observables` say what
sensors and meters read. `configured` is the motor on another rig, `ageing_law` the motor of an old specimen;
`scaling`, `slicing` and `merging` make motors from motors.
"""
