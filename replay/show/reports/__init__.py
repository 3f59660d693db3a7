"""Whole documents: reports of replays, diagnoses, protocols, mornings and ageing; pages over a store.

`report`, `diagnosis_report`, `protocol_report`, `morning_report`, `repeat_report` and `ageing_report` are HTML files
that need no other; `documents` finds what they and the viewer's layers are made of in a store. `verdict` words a
diagnosis, the same for the terminal (`diagnosis_text`), report and viewer; `seen` and `bisect` say since when a cause
acts. `site` keeps a folder of such pages up to date, `site_pages` says which, `site_index` is the first of them.
"""
