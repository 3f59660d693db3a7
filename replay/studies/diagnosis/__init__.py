"""Why the motor is hotter than the model says: the question, the search, kept sessions, the answer and the new files."""
