"""What a trial is made of: a motor of `tests/plant` that hides something, its logs, the diagnosis, and what is counted.

`one` is a whole trial. `cases` says what hides in whom, `sizes` how large it is, `campaigns` makes the logs and reads
them, `visibility` says how well each hidden effect can be seen, `answers` diagnoses, `lost` names the step that lost a
cause, `explained` how much the whole truth would explain, `inside` holds models against the plant where no sensor sits,
`audit` asks how far healthy motors are from their priors, `rates` counts and prints.
"""
