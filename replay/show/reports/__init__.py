"""Whole documents: the reports of replays, diagnoses, protocols and mornings.

`report`, `diagnosis_report`, `protocol_report`, `morning_report` and `repeat_report` are HTML files that need no other;
`documents` finds what they and the viewer's layers are made of in a store. `verdict` words a
diagnosis, the same for the terminal (`diagnosis_text`), report and viewer.
"""
