"""What a campaign could find, and the next bench day as a file that a bench can run.

`plan` is the study, `written` the file.
"""
