"""Why the motor is hotter than the model says: the question, the search, kept sessions, the answer and the new files.

`diagnose` asks: `question` gathers sessions and key, `search` searches, `kept_sessions` asks those that nothing was
learnt from, where they are `comparable`, as fitted and `as_recorded`.
`data_faults`, `named_faults` and `contradicting` weigh the record itself. `chain` says what each term brought,
`two_models` what it changes where no sensor is. `answer` is the dataclass and its one JSON, filled by `answer_parts`
and by `beyond_usual` (what is unusual before any cause); `extension` writes the new motor and bench file, `offered` are
those that replay, `formulas` says them with units; `pictured` is what reports draw of cause, rivals and next test.
`accept` is the person's word, `review` what they should know before.
"""
