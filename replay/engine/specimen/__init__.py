"""The motor as the specimen of a session has it: what it went through before, and what is left of its numbers."""
