"""Why the motor is hotter than the model says: the question, the search, kept sessions, the answer and the new files.

`diagnose` asks: `question` gathers sessions and key, `search` searches, `kept_sessions` asks those that nothing was
learnt from, `data_faults` and `named_faults` weigh the record itself. `answer` is the dataclass and its one JSON,
filled by `answer_parts` and by `beyond_usual` (what is unusual before any cause); `extension` writes the new motor and
bench file, `formulas` says them with units; `pictured` is what reports draw of cause, rivals and next test. `accept` is
the person's word.
"""
