"""The input frame: the one narrow door from a session's channels into the twin."""
