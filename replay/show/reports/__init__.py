"""Whole documents: the reports of replays, diagnoses and protocols, and the layers for the viewer.

`report`, `diagnosis_report` and `protocol_report` are HTML files that need no other; `layers` and `blueprint` are for
the viewer; `documents` finds what they are made of in a store. `verdict` words a diagnosis, the same for the terminal
(`diagnosis_text`), report and viewer.
"""
