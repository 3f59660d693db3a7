"""What a campaign could find, and the next bench day as a file that a bench can run.

`plan` is the study, `listed` reads tests that have not been run, `written` is the file. `promised` holds a plan against
what came.
"""
