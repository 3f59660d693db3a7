"""Whole documents: the reports of replays, diagnoses, protocols and mornings, and the layers for the viewer.

`report`, `diagnosis_report`, `protocol_report`, `morning_report` and `repeat_report` are HTML files that need no other;
`layers` and `blueprint` are for the viewer; `documents` finds what they are made of in a store. `verdict` words a
diagnosis, the same for the terminal (`diagnosis_text`), report and viewer.
"""
