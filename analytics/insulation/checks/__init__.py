"""A DC check as arrays: its thermal resistance by the most trusted route that serves, and how well checks repeat."""
